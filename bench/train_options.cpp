#include "duet/bench/train_options.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <sstream>

#include "duet/bench/suite_names.h"
#include "duet/core/number.h"

namespace duet {
namespace {

constexpr int kMostClips = 100000;
constexpr FieldRange kThreads = {1, 1024}, kCount = {1, 1e9}, kNotNegative = {0, 1e9};

// One of the known texts, as it is.
template <typename Owner>
Field<Owner> word_field(FieldWords words, const std::vector<std::string>& known, std::string Owner::*member) {
  words.choices = known;
  return field<Owner>(
      words, fmt::format("{}", fmt::join(known, ", ")), [member](const Owner& owner) { return owner.*member; },
      [words, member](Owner& owner, const std::string& text) {
        std::size_t index = 0;
        std::string expected = assign_choice(words, text, index);
        if (expected.empty()) owner.*member = text;
        return expected;
      });
}

std::vector<std::string> wbc_stage_names() {
  std::vector<std::string> names = {"all"};
  for (const WbcStage& stage : wbc_plan()) names.push_back(stage.name);
  return names;
}

// "rehearsed:80 people:400": the manner and how many clips of each task.
std::string text_of(const std::vector<DemonstrationClips>& clips) {
  std::vector<std::string> kinds;
  kinds.reserve(clips.size());
  for (const auto& [like, per_task] : clips)
    kinds.push_back(fmt::format("{}:{}", name_of(likeness_names(), like), per_task));
  return fmt::format("{}", fmt::join(kinds, " "));
}

std::string read_clips(PolicyTraining& training, const std::string& text) {
  std::vector<DemonstrationClips> clips;
  std::istringstream kinds(text);
  for (std::string kind; kinds >> kind;) {
    const auto colon = kind.find(':');
    const std::optional<double> count =
        colon == std::string::npos ? std::nullopt : parse_number(kind.substr(colon + 1));
    if (!count || *count < 1.0 || *count > kMostClips || *count != std::floor(*count))
      return fmt::format("a manner, ':' and 1 to {} clips, as in people:400", kMostClips);
    std::size_t like = 0;
    const std::vector<std::string> manners = choices_of(likeness_names());
    if (!assign_choice({.choices = manners}, kind.substr(0, colon), like).empty())
      return fmt::format("{} before the ':'", fmt::join(manners, " or "));
    clips.push_back({static_cast<Likeness>(like), static_cast<int>(*count)});
  }
  if (clips.empty()) return "at least one kind of clip, as people:400";
  training.data.clips = std::move(clips);
  return "";
}

FieldTable<PolicyTraining> demonstration_fields() {
  using T = PolicyTraining;
  return {
      field<T>(
          {.name = "clips", .meaning = "synthesised clips of each task by whose way people have (docs/synthesis.md)"},
          "rehearsed:N, people:N or both", [](const T& training) { return text_of(training.data.clips); }, read_clips),
      field<T>(
          {.name = "mode", .meaning = "of retargeting: paper, grounded or best"},
          [](auto& t) -> auto& { return t.data.pair_mode; }),
      field<T>(
          {.name = "starts", .meaning = "starts of each clip", .range = kCount},
          [](auto& t) -> auto& { return t.data.starts; }),
      field<T>(
          {.name = "start",
           .meaning = "how the robot comes: approach (A.4.4) or sim_to_real (Algorithm 7, before it meets the real "
                      "robot: one start)",
           .choices = {"approach", "sim_to_real"}},
          [](auto& t) -> auto& { return t.start; }),
      field<T>(
          {.name = "followed",
           .meaning = "clips of each task that the robot follows in the engine",
           .range = kNotNegative},
          [](auto& t) -> auto& { return t.data.followed; }),
      field<T>(
          {.name = "engine", .meaning = "that they are followed in; '' for none"},
          [](auto& t) -> auto& { return t.data.engine; }),
      field<T>(
          {.name = "controller_network",
           .meaning =
               "network of WBC-Sim under which they are: braced, student or a file; its default where none is given"},
          [](auto& t) -> auto& { return t.data.controller_network; }),
      field<T>({.name = "rounds",
                .meaning = "times that the policy so far acts in the engine and what it meets is added to the "
                           "demonstrations",
                .range = kNotNegative},
               &T::rounds),
      field<T>({.name = "round_clips", .meaning = "clips of each task on which it then acts", .range = kNotNegative},
               &T::round_clips)};
}

FieldTable<PolicyTraining> learning_fields() {
  using T = PolicyTraining;
  return {
      field<T>(
          {.name = "steps", .meaning = "of Adam", .range = kCount}, [](auto& t) -> auto& { return t.run.steps; }),
      field<T>(
          {.name = "batch", .meaning = "windows, a multiple of the threads", .range = kCount},
          [](auto& t) -> auto& { return t.run.batch; }),
      field<T>(
          {.name = "rate", .meaning = "of Adam", .range = {0.0, 1.0, false}},
          [](auto& t) -> auto& { return t.run.rate; }),
      field<T>(
          {.name = "seed", .meaning = "of weights, windows and noise"}, [](auto& t) -> auto& { return t.run.seed; }),
      field<T>({.name = "threads",
                .meaning = "the result depends on it; as many as the machine has where none is given",
                .range = kThreads},
               &T::threads),
      field<T>({.name = "from", .meaning = "network to begin with (fine-tuning); new weights where none is given"},
               &T::from),
      field<T>(
          {.name = "device", .meaning = "auto (the GPU if libtorch has one), cpu, cuda"},
          [](auto& t) -> auto& { return t.run.device; }),
      field<T>({.name = "config", .meaning = "JSON of the network's shape; the one that ships where none is given"},
               &T::config),
      field<T>({.name = "language", .meaning = "NPZ of prompts and embeddings; built in where none is given"},
               &T::language),
      field<T>(
          {.name = "split", .meaning = "test split that may not be learnt; the one that ships where none is given"},
          &T::split)};
}

}  // namespace

const FieldTable<WbcTraining>& wbc_training_fields() {
  using T = WbcTraining;
  static const FieldTable<T> table = {
      word_field<T>({.name = "stage",
                     .meaning = "all: each in turn: stand, walk, brace (pushes), interact (clips, too), student"},
                    wbc_stage_names(), &T::stage),
      field<T>(
          {.name = "output", .meaning = "folder: one subfolder per stage"},
          [](auto& t) -> auto& { return t.run.folder; }),
      field<T>(
          {.name = "from",
           .meaning = "checkpoint, or the network of an oracle, to begin with; the stage before in the folder where "
                      "none is given"},
          [](auto& t) -> auto& { return t.run.from; }),
      field<T>(
          {.name = "steps", .meaning = "of the environment, in all; 0: the stage's", .range = {0, 9e15}},
          [](auto& t) -> auto& { return t.run.steps; }),
      field<T>(
          {.name = "seed", .meaning = "of weights, commands and noise"}, [](auto& t) -> auto& { return t.run.seed; }),
      field<T>({.name = "threads",
                .meaning = "the result depends on it; as many as the machine has where none is given",
                .range = kThreads},
               &T::threads),
      field<T>(
          {.name = "environments", .meaning = "a multiple of the threads", .range = kCount},
          [](auto& t) -> auto& { return t.run.environments; }),
      field<T>({.name = "card", .meaning = "robot card by name or path; the G1 where none is given"}, &T::card)};
  return table;
}

const FieldTable<PolicyTraining>& policy_training_fields() {
  static const FieldTable<PolicyTraining> table = [] {
    using T = PolicyTraining;
    FieldTable<T> fields = {field<T>(
        {.name = "output", .meaning = "folder: demonstrations in data/, one subfolder per policy"},
        [](auto& t) -> auto& { return t.run.folder; })};
    for (Field<T>& each : demonstration_fields()) fields.push_back(std::move(each));
    for (Field<T>& each : learning_fields()) fields.push_back(std::move(each));
    return fields;
  }();
  return table;
}

}  // namespace duet
