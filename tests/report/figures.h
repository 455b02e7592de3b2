// Finding a figure of an analysis by what it is of.
#pragma once

#include <fmt/format.h>

#include <stdexcept>

#include "duet/report/tables/analysis.h"

namespace duet::test {

// Those whose name, source, `of` and keys are those given; a key left empty fits any.
inline std::vector<Figure> figures_like(const Analysis& analysis, const Figure& like) {
  std::vector<Figure> found;
  for (const Figure& figure : analysis.figures) {
    bool fits = figure.name == like.name && figure.source == like.source && figure.of == like.of;
    for (const auto key :
         {&Figure::engine, &Figure::controller, &Figure::policy, &Figure::arm, &Figure::perturbation, &Figure::task})
      fits = fits && ((like.*key).empty() || figure.*key == like.*key);
    if (fits) found.push_back(figure);
  }
  return found;
}

// The only one.
inline Figure figure(const Analysis& analysis, const Figure& like) {
  std::vector<Figure> found = figures_like(analysis, like);
  if (found.size() != 1)
    throw std::runtime_error(fmt::format("{} figures '{}' in {}", found.size(), like.name, analysis.name));
  return found.front();
}

}  // namespace duet::test
