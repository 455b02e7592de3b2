// duet retarget: PAIR over clips.
#include <fmt/format.h>

#include <filesystem>

#include "duet/app/command.h"
#include "duet/app/retarget_comparison.h"
#include "duet/core/file.h"
#include "duet/core/machine.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/experiment/plan/clips.h"
#include "duet/motion/plausibility.h"
#include "duet/retarget/pair_chain.h"
#include "duet/retarget/solver/pair.h"

namespace duet::cli {
namespace {

struct RetargetArguments {
  std::vector<std::string> inputs, options;
  std::string output, card, urdf, reactor;
  std::vector<std::string> compare;
  bool as_is = false, sweep = false, both = false;
  int threads = default_threads();
};

// One input file may name its output file; several go into a folder under their own names, followed by what --robot
// adds to the clip's id.
std::string output_path(const RetargetArguments& arguments, const std::string& input, size_t inputs,
                        const std::string& suffix) {
  const std::filesystem::path output(arguments.output), file(input);
  if (inputs == 1 && output.extension() == ".npz") return output.string();
  return (output / (file.stem().string() + suffix + file.extension().string())).string();
}

// Makes the robot replace this person, where one is named; returns what that adds to the clip's id.
std::string replace_reactor(const std::string& reactor, InteractionClip& clip) {
  if (reactor.empty()) return "";
  const std::string id = clip.id;
  set_reactor(clip, reactor == "A" ? Person::kA : Person::kB);
  return clip.id == id ? "" : "-" + reactor;
}

struct Retargeted {
  std::string line;
  nlohmann::json result;
  std::vector<std::string> notes;
};

Retargeted retarget_file(const std::string& file, size_t files, const RetargetArguments& arguments,
                         const RobotModel& robot, const PairOptions& options) {
  ImportedClip read =
      read_foreign_clip(Npz::load(file), arguments.as_is ? Implausible::kAllowed : Implausible::kRefused);
  const std::string suffix = replace_reactor(arguments.reactor, read.clip);
  const PairedMotion paired = retarget(read.clip, robot, options);
  const std::string path = output_path(arguments, file, files, suffix);
  save_paired_motion(paired, path);
  const std::vector<double>& kinematic = paired.loss.at("kin");
  const std::vector<double>& contact = paired.loss.at("con");
  return {fmt::format("{}: {} frames, L_kin {:.3f} -> {:.3f}, L_con {:.3f} -> {:.3f}\n", path, paired.frames(),
                      kinematic.front(), kinematic.back(), contact.front(), contact.back()),
          {{"file", path},
           {"clip", paired.clip_id},
           {"frames", paired.frames()},
           {"l_kin", {kinematic.front(), kinematic.back()}},
           {"l_con", {contact.front(), contact.back()}},
           {"settings", paired.settings}},
          std::move(read.notes)};
}

PairChoices choices_of(const RetargetArguments& arguments) {
  PairChoices choices;
  for (const std::string& option : arguments.options) choices.emplace_back(split_assignment(option));
  return choices;
}

std::vector<InteractionClip> clips_to_compare(const Session& session, const RetargetArguments& arguments) {
  std::vector<InteractionClip> clips;
  for (const std::string& file : find_motion_files(arguments.inputs)) {
    with_file_context(file, [&] {
      ImportedClip read =
          read_foreign_clip(Npz::load(file), arguments.as_is ? Implausible::kAllowed : Implausible::kRefused);
      for (const std::string& sentence : read.notes) note(session, sentence);
      if (!arguments.reactor.empty()) replace_reactor(arguments.reactor, read.clip);
      clips.push_back(read.clip);
      if (!arguments.both) return;
      set_reactor(clips.back(), clips.back().reactor == Person::kA ? Person::kB : Person::kA);
      clips.push_back(std::move(read.clip));
    });
  }
  return clips;
}

// No file is written: the table is the result.
void run_comparison(const Session& session, const RetargetArguments& arguments, const RobotModel& robot) {
  const PairChoices choices = choices_of(arguments);
  const std::vector<RetargetVariant> variants =
      arguments.sweep ? weight_variants(make_pair_options(choices)) : mode_variants(arguments.compare, choices);
  Progress progress(session.progress());
  const std::vector<ComparedVariant> compared =
      compare_retargeting(clips_to_compare(session, arguments), variants, robot, arguments.threads, progress);
  print(session, arguments.sweep ? weights_table(compared) : comparison_table(compared),
        {{"compared", comparison_json(compared)}});
}

void run_retarget(const Session& session, const RetargetArguments& arguments) {
  const PairOptions options = make_pair_options(choices_of(arguments));
  require(arguments.reactor.empty() || arguments.reactor == "A" || arguments.reactor == "B",
          "--robot: expected A or B, found '{}'", arguments.reactor);
  const std::string card = arguments.card.empty() ? default_card_path() : card_path(arguments.card);
  const RobotModel robot = load_robot(card, arguments.urdf);
  if (arguments.sweep || !arguments.compare.empty()) return run_comparison(session, arguments, robot);
  require(!arguments.output.empty(), "retarget: expected --output FOLDER, or --compare or --sweep");
  with_file_context(card, [&] { (void)make_chain(robot, options.keypoints, options.keypoint_list); });
  const std::vector<std::string> files = find_motion_files(arguments.inputs);
  std::vector<Retargeted> made(files.size());
  Progress progress(session.progress());
  progress.start("retargeting", static_cast<int>(files.size()), "clips");
  parallel_for_each(static_cast<int>(files.size()), arguments.threads, [&](int i) {
    made[i] =
        with_file_context(files[i], [&] { return retarget_file(files[i], files.size(), arguments, robot, options); });
    progress.advance();
  });
  progress.finish();
  constexpr size_t kListed = 10;
  std::string text;
  nlohmann::json results = nlohmann::json::array();
  for (size_t i = 0; i < made.size(); ++i) {
    for (const std::string& sentence : made[i].notes) note(session, sentence);
    if (i < kListed) text += made[i].line;
    results.push_back(std::move(made[i].result));
  }
  if (made.size() > kListed) text += fmt::format("... and {} more in {}\n", made.size() - kListed, arguments.output);
  print(session, text, {{"paired", results}});
  suggest_next(session, fmt::format("duet run demo --clips {} -o runs/mine", shell_word(arguments.output)));
}

}  // namespace

void add_retarget(CLI::App& app, Session& session) {
  CLI::App* command = add_command(app, session, "retarget", "PAIR: one person of each clip becomes the robot",
                                  "duet retarget clips --output paired --option mode=best\n"
                                  "  duet retarget clips --compare paper,grounded,best");
  auto arguments = std::make_shared<RetargetArguments>();
  command->add_option("clips", arguments->inputs, "clips (NPZ) or folders of them")->required();
  command->add_option("-o,--output", arguments->output, "folder, or a file for one clip");
  command->add_option("--option", arguments->options, "name=value; `duet list pair-options` shows all (repeatable)");
  command->add_option(
      "--robot", arguments->reactor,
      "who the robot replaces: A or B (default: as in the clip); another than in the clip is added to its id");
  command->add_option("--card", arguments->card, "robot card by name or path (default: the G1)");
  command->add_flag("--as-is", arguments->as_is, "take clips however implausible their people are");
  command->add_option("--urdf", arguments->urdf, "URDF in the place of the card's");
  auto* compare = command->add_option("--compare", arguments->compare,
                                      "modes side by side, as paper,grounded,best: a table instead of motions");
  compare->delimiter(',');
  command->add_flag("--sweep", arguments->sweep, "Table S8: each weight times 0.5 and 2; a table instead of motions")
      ->excludes(compare);
  command->add_flag("--both", arguments->both, "with --compare and --sweep: each person of a clip is replaced in turn");
  add_threads(command, arguments->threads);
  command->callback([&session, arguments] { run_retarget(session, *arguments); });
}

}  // namespace duet::cli
