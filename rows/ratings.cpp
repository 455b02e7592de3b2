#include "duet/rows/ratings.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <set>

#include "duet/archives/csv.h"
#include "duet/core/file.h"
#include "duet/core/names.h"
#include "duet/core/require.h"

namespace duet {
namespace {

using Keys = std::set<std::string_view>;

const std::array<std::string, 3> kRatingColumns = {"episode", "rater", "answer"};

Answer answer_of(const std::string& word, const CsvReader& lines) {
  const std::vector<std::string> names(std::begin(kAnswerNames), std::end(kAnswerNames));
  const auto found = std::ranges::find(names, word);
  if (found == names.end()) lines.fail(unknown_name_message("answer", excerpt(word), names));
  return static_cast<Answer>(found - names.begin());
}

void add_line(const CsvReader& lines, Rater& rater) {
  const std::span<const std::string> fields = lines.fields();
  if (fields.size() != kRatingColumns.size())
    lines.fail(fmt::format("expected 3 fields (episode, rater, answer), found {}", fields.size()));
  if (fields[1].empty()) lines.fail("expected the rater's name, found nothing");
  if (rater.name.empty()) rater.name = fields[1];
  if (fields[1] != rater.name)
    lines.fail(
        fmt::format("expected the answers of one rater, '{}', found '{}'", excerpt(rater.name), excerpt(fields[1])));
  if (!rater.answers.try_emplace(fields[0], answer_of(fields[2], lines)).second)
    lines.fail(fmt::format("episode '{}' is answered already", excerpt(fields[0])));
}

Rater read_rater(const std::string& file, const Keys& known, const std::string& run) {
  const std::string text = read_text(file);
  Rater rater{.name = "", .file = file, .answers = {}};
  std::string unknown;  // what is wrong with the first episode that the run lacks
  CsvReader lines(text, file);
  require_header(lines, kRatingColumns);
  while (lines.next()) {
    if (lines.blank()) continue;
    add_line(lines, rater);
    const std::string& key = lines.fields()[0];
    if (unknown.empty() && !known.contains(key))
      unknown =
          fmt::format("'{}': line {}: expected an episode of '{}', found '{}'", file, lines.line(), run, excerpt(key));
  }
  if (rater.answers.empty()) throw InputError(fmt::format("'{}': expected a line for each answer, found none", file));
  if (std::ranges::none_of(rater.answers, [&](const auto& answer) { return known.contains(answer.first); }))
    throw InputError(
        fmt::format("'{}': these are ratings of another run: of their episodes none is in '{}'", file, run));
  if (!unknown.empty()) throw InputError(unknown);
  return rater;
}

}  // namespace

std::vector<Rater> read_ratings(std::span<const std::string> files, const std::vector<EpisodeRow>& rows,
                                const std::string& run) {
  Keys known;
  for (const EpisodeRow& row : rows) known.insert(row.key);
  std::vector<Rater> raters;
  for (const std::string& file : files) {
    Rater rater = read_rater(file, known, run);
    const auto same = std::ranges::find(raters, rater.name, &Rater::name);
    if (same != raters.end())
      throw InputError(fmt::format("'{}': expected another rater than in '{}', found '{}' again", file, same->file,
                                   excerpt(rater.name)));
    raters.push_back(std::move(rater));
  }
  return raters;
}

}  // namespace duet
