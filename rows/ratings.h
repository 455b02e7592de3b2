// Judgements by people of a run's episodes: did the robot do what it was asked to? One CSV file a rater, as the page of
// `duet rate` exports it (docs/human-agreement.md).
#pragma once

#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "duet/rows/episode_row.h"

namespace duet {

enum class Answer { kNo, kYes, kUnsure };
inline constexpr std::string_view kAnswerNames[] = {"no", "yes", "unsure"};
inline std::string_view to_string(Answer answer) { return kAnswerNames[static_cast<int>(answer)]; }

struct Rater {
  std::string name, file;
  std::map<std::string, Answer> answers;  // by the episode's key; at least one
};

// Raters in the order of the files. `run`: its name in messages. Throws InputError naming file and line: another
// header, a file without an answer, of another run, an episode that the run lacks, an answer of another word, a rater
// without a name, two raters in one file, a rater in two files, an episode answered twice.
std::vector<Rater> read_ratings(std::span<const std::string> files, const std::vector<EpisodeRow>& rows,
                                const std::string& run);

}  // namespace duet
