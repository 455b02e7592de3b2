#include "duet/training/setup/train_options.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>
#include <stdexcept>

#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/experiment/suite/suite.h"

namespace duet {
namespace {

constexpr int kMostClips = 100000;
constexpr FieldRange kThreads = {1, 1024}, kCount = {1, 1e9}, kNotNegative = {0, 1e9};

// One of the known texts, as it is.
template <typename Owner>
Field<Owner> word_field(FieldDoc words, const std::vector<std::string>& known, std::string Owner::*member) {
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

std::string read_retargeting(PolicyTraining& training, const std::string& text) {
  try {
    parse_retargeting(text);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  training.data.retargeting = text;
  return "";
}

FieldTable<PolicyTraining> demonstration_fields() {
  using T = PolicyTraining;
  return {
      field<T>(
          {.name = "clips", .meaning = "synthesised clips of each task by whose way people have (docs/synthesis.md)"},
          "MANNER:N, of rehearsed, people and varied", [](const T& training) { return text_of(training.data.clips); },
          read_clips),
      field<T>(
          {.name = "mode", .meaning = "of retargeting: paper, grounded or best, and options of PAIR after it"},
          "a mode and name=value, as in best w-kin=8", [](const T& training) { return training.data.retargeting; },
          read_retargeting),
      field<T>(
          {.name = "starts", .meaning = "starts of each clip", .range = kCount},
          [](auto& t) -> auto& { return t.data.starts; }),
      field<T>(
          {.name = "start",
           .meaning = "how the robot comes: approach (A.4.4), sim_to_real (Algorithm 7, before it meets the real "
                      "robot: one start), answer (as approach, but it is there early, waits, and begins after its "
                      "partner) or lead (as answer, but half of the gestures are its to begin: the command says so)",
           .choices = {"approach", "sim_to_real", "answer", "lead"}},
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

const std::set<std::string>& training_flags() {
  static const std::set<std::string> flags = {"quiet", "smoke"};
  return flags;
}

// The value that was expected of this option; "" where `value` is one.
template <typename Training>
std::string expected_of(const FieldTable<Training>& table, const std::string& name, const std::string& value,
                        const std::string& what) {
  std::vector<std::string> known = field_names(table);
  std::erase_if(known, [](const std::string& other) { return other == "output" || other == "seed"; });
  if (std::ranges::find(known, name) == known.end()) {
    known.insert(known.end(), training_flags().begin(), training_flags().end());
    throw InputError(fmt::format("{}: {}", what, unknown_name_message("option of a training", name, known)));
  }
  Training defaults;
  return set_field(*find_field(table, name), defaults, value);
}

// "--round-clips" -> "round_clips"; throws for a word that is no option.
std::string option_name(const std::string& word, const std::string& what) {
  if (!word.starts_with("--"))
    throw InputError(fmt::format("{}: expected an option of `duet train`, found '{}'", what, excerpt(word)));
  std::string name = word.substr(2, word.find('=') - 2);
  std::ranges::replace(name, '-', '_');
  return name;
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

std::vector<std::string> training_names() {
  std::vector<std::string> names = {"wbc"};
  for (const std::string& variant : dstar_variants()) names.push_back(variant);
  return names;
}

void check_training_option(const std::string& train, const std::string& name, const std::string& value,
                           const std::string& what) {
  const std::vector<std::string> known = training_names();
  if (std::ranges::find(known, train) == known.end())
    throw InputError(fmt::format("{}: {}", what, unknown_name_message("training", train, known)));
  std::string expected;
  if (training_flags().contains(name)) {
    expected = value.empty() ? "" : "no value of a flag";
  } else if (train == "wbc") {
    expected = expected_of(wbc_training_fields(), name, value, what);
  } else {
    expected = expected_of(policy_training_fields(), name, value, what);
  }
  if (!expected.empty())
    throw InputError(fmt::format("{}: option '{}': expected {}, found '{}'", what, name, expected, excerpt(value)));
}

TrainingOptions parse_training_options(const std::string& train, const std::vector<std::string>& words,
                                       const std::string& what) {
  TrainingOptions options;
  for (auto word = words.begin(); word != words.end();) {
    const std::string name = option_name(*word, what);
    const std::size_t equals = word->find('=');
    std::vector<std::string> values;
    if (equals != std::string::npos) values.push_back(word->substr(equals + 1));
    const bool takes_more = equals == std::string::npos && !training_flags().contains(name);
    for (++word; takes_more && word != words.end() && !word->starts_with("--"); ++word) values.push_back(*word);
    const std::string value = fmt::format("{}", fmt::join(values, " "));
    check_training_option(train, name, value, what);
    if (!options.emplace(name, value).second)
      throw InputError(fmt::format("{}: expected the option '{}' once, found it twice", what, name));
  }
  return options;
}

std::vector<std::string> training_command(const std::string& train, const TrainingOptions& options, std::uint64_t seed,
                                          const std::string& folder) {
  std::vector<std::string> words = {"train", train};
  for (const auto& [name, value] : options) {
    std::string& option = words.emplace_back("--" + name);
    std::ranges::replace(option, '_', '-');
    if (!training_flags().contains(name)) words.push_back(value);
  }
  for (const std::string& word : {std::string("--seed"), std::to_string(seed), std::string("-o"), folder})
    words.push_back(word);
  return words;
}

}  // namespace duet
