// duet retarget: PAIR over clips.
#include <fmt/format.h>

#include <filesystem>

#include "bench/cli/command.h"
#include "bench/clips.h"
#include "bench/parallel.h"
#include "core/naming_file.h"
#include "core/require.h"
#include "motion/plausibility.h"
#include "retarget/pair.h"
#include "retarget/pair_chain.h"

namespace duet::cli {
namespace {

struct RetargetArguments {
  std::vector<std::string> inputs, options;
  std::string output, card, urdf, reactor;
  bool as_is = false;
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

// Who the robot replaces, where told; what that adds to the clip's id.
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
  ForeignClip read = read_foreign_clip(Npz::load(file), arguments.as_is ? Implausible::kTaken : Implausible::kRefused);
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

PairOptions options_of(const RetargetArguments& arguments) {
  PairOptions options;
  for (const std::string& option : arguments.options) {
    const auto [name, value] = split_assignment(option);
    set_pair_option(options, name, value);
  }
  return options;
}

void run_retarget(const Session& session, const RetargetArguments& arguments) {
  const PairOptions options = options_of(arguments);
  require(arguments.reactor.empty() || arguments.reactor == "A" || arguments.reactor == "B",
          fmt::format("--robot: expected A or B, found '{}'", arguments.reactor));
  const std::string card = arguments.card.empty() ? default_card_path() : arguments.card;
  const RobotModel robot = load_robot(card, arguments.urdf);
  naming_file(card, [&] { (void)make_chain(robot, options.keypoints); });
  const std::vector<std::string> files = find_motion_files(arguments.inputs);
  std::vector<Retargeted> made(files.size());
  Progress progress(session.progress());
  progress.start("retargeting", static_cast<int>(files.size()), "clips");
  parallel_for_each(static_cast<int>(files.size()), arguments.threads, [&](int i) {
    made[i] = naming_file(files[i], [&] { return retarget_file(files[i], files.size(), arguments, robot, options); });
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
}

}  // namespace

void add_retarget(CLI::App& app, Session& session) {
  CLI::App* command = add_command(app, session, "retarget", "PAIR: one person of each clip becomes the robot",
                                  "duet retarget clips --output paired --option root=per-frame");
  auto arguments = std::make_shared<RetargetArguments>();
  command->add_option("clips", arguments->inputs, "clips (NPZ) or folders of them")->required();
  command->add_option("-o,--output", arguments->output, "folder, or a file for one clip")->required();
  command->add_option("--option", arguments->options, "name=value; `duet list pair-options` shows all (repeatable)");
  command->add_option(
      "--robot", arguments->reactor,
      "who the robot replaces: A or B (default: as in the clip); another than in the clip is added to its id");
  command->add_option("--card", arguments->card, "robot card (default: the G1 that ships with duet)");
  command->add_flag("--as-is", arguments->as_is, "take clips however implausible their people are");
  command->add_option("--urdf", arguments->urdf, "URDF in the place of the card's");
  add_threads(command, arguments->threads);
  command->callback([&session, arguments] { run_retarget(session, *arguments); });
}

}  // namespace duet::cli
