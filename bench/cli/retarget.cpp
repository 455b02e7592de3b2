// duet retarget: PAIR over clips.
#include <fmt/format.h>

#include <filesystem>

#include "bench/cli/command.h"
#include "bench/clips.h"
#include "bench/parallel.h"
#include "core/require.h"
#include "retarget/pair.h"

namespace duet::cli {
namespace {

struct RetargetArguments {
  std::vector<std::string> inputs, options;
  std::string output, card, urdf, reactor;
  int threads = default_threads();
};

// One input file may name its output file; several go into a folder under their own names.
std::string output_path(const RetargetArguments& arguments, const std::string& input, size_t inputs) {
  const std::filesystem::path output(arguments.output);
  if (inputs == 1 && output.extension() == ".npz") return output.string();
  return (output / std::filesystem::path(input).filename()).string();
}

void run_retarget(const Session& session, const RetargetArguments& arguments) {
  PairOptions options;
  for (const std::string& option : arguments.options) {
    const auto [name, value] = split_assignment(option);
    set_pair_option(options, name, value);
  }
  require(arguments.reactor.empty() || arguments.reactor == "A" || arguments.reactor == "B",
          fmt::format("--robot: expected A or B, found '{}'", arguments.reactor));
  const RobotModel robot = load_robot(arguments.card.empty() ? default_card_path() : arguments.card, arguments.urdf);
  const std::vector<std::string> files = find_motion_files(arguments.inputs);
  std::vector<nlohmann::json> results(files.size());
  std::vector<std::string> lines(files.size());
  Progress progress(session.progress());
  progress.start("retargeting", static_cast<int>(files.size()), "clips");
  parallel_for_each(static_cast<int>(files.size()), arguments.threads, [&](int i) {
    InteractionClip clip = load_clip(files[i]);
    if (!arguments.reactor.empty()) clip.reactor = arguments.reactor == "A" ? Person::kA : Person::kB;
    const PairedMotion paired = retarget(clip, robot, options);
    const std::string path = output_path(arguments, files[i], files.size());
    save_paired_motion(paired, path);
    const std::vector<double>& kinematic = paired.loss.at("kin");
    const std::vector<double>& contact = paired.loss.at("con");
    lines[i] = fmt::format("{}: {} frames, L_kin {:.3f} -> {:.3f}, L_con {:.3f} -> {:.3f}\n", path, paired.frames(),
                           kinematic.front(), kinematic.back(), contact.front(), contact.back());
    results[i] = {{"file", path},
                  {"clip", paired.clip_id},
                  {"frames", paired.frames()},
                  {"l_kin", {kinematic.front(), kinematic.back()}},
                  {"l_con", {contact.front(), contact.back()}},
                  {"settings", paired.settings}};
    progress.advance();
  });
  progress.finish();
  constexpr size_t kListed = 10;
  std::string text;
  for (size_t i = 0; i < lines.size() && i < kListed; ++i) text += lines[i];
  if (lines.size() > kListed) text += fmt::format("... and {} more in {}\n", lines.size() - kListed, arguments.output);
  print(session, text, {{"paired", results}});
}

}  // namespace

void add_retarget(CLI::App& app, Session& session) {
  CLI::App* command = add_command(app, session, "retarget", "PAIR: one person of each clip becomes the robot",
                                  "duet retarget clips --output paired --option root-translation=per-frame");
  auto arguments = std::make_shared<RetargetArguments>();
  command->add_option("clips", arguments->inputs, "clips (NPZ) or folders of them")->required();
  command->add_option("-o,--output", arguments->output, "folder, or a file for one clip")->required();
  command->add_option("--option", arguments->options, "name=value; `duet list pair-options` shows all (repeatable)");
  command->add_option("--robot", arguments->reactor, "who the robot replaces: A or B (default: as in the clip)");
  command->add_option("--card", arguments->card, "robot card (default: the G1 that ships with duet)");
  command->add_option("--urdf", arguments->urdf, "URDF in the place of the card's");
  command->add_option("-j,--threads", arguments->threads, "threads")->capture_default_str();
  command->callback([&session, arguments] { run_retarget(session, *arguments); });
}

}  // namespace duet::cli
