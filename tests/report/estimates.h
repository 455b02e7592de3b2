// Finding an estimate of an analysis by what it is of.
#pragma once

#include <fmt/format.h>

#include <stdexcept>

#include "duet/report/tables/analysis.h"

namespace duet::test {

// Those whose name, source, `of` and keys are those given; a key left empty fits any.
inline std::vector<Estimate> estimates_like(const Analysis& analysis, const Estimate& like) {
  std::vector<Estimate> found;
  for (const Estimate& each : analysis.estimates) {
    bool fits = each.name == like.name && each.source == like.source && each.of == like.of;
    for (const auto key : {&Estimate::engine, &Estimate::controller, &Estimate::policy, &Estimate::arm,
                           &Estimate::perturbation, &Estimate::task})
      fits = fits && ((like.*key).empty() || each.*key == like.*key);
    if (fits) found.push_back(each);
  }
  return found;
}

// The only one.
inline Estimate estimate(const Analysis& analysis, const Estimate& like) {
  std::vector<Estimate> found = estimates_like(analysis, like);
  if (found.size() != 1)
    throw std::runtime_error(fmt::format("{} estimates '{}' in {}", found.size(), like.name, analysis.name));
  return found.front();
}

}  // namespace duet::test
