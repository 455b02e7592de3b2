// duet convert: robot motions from any of the known formats into another.
#include <fmt/format.h>

#include "duet/core/parallel.h"
#include "duet/core/require.h"
#include "duet/parts/data/convert.h"
#include "duet/parts/data/part.h"
#include "duet/parts/data/robot_motion_options.h"

namespace duet::cli {
namespace {

struct ConvertArguments {
  std::vector<std::string> inputs;
  std::string output, to, card, order, prepare, format;
  RobotMotionArguments reading;
  std::optional<double> rate_hz;
  int threads = default_threads();
};

ConversionOptions conversion_of(const ConvertArguments& arguments) {
  ConversionOptions options{.to = arguments.to, .from = arguments.format};
  if (options.to != "paired")
    require(robot_motion_format(options.to).write != nullptr, "--to: format '{}' is read, not written", options.to);
  require(arguments.prepare.empty() || arguments.prepare == "sim-to-real",
          "--prepare: expected sim-to-real, found '{}'", arguments.prepare);
  options.sim_to_real = !arguments.prepare.empty();
  options.reading = options_of(arguments.reading);
  options.writing.rate_hz = arguments.rate_hz;
  if (!arguments.order.empty()) options.writing.order = parse_tree_order(arguments.order);
  return options;
}

void run_convert(const Session& session, const ConvertArguments& arguments) {
  const ConversionOptions options = conversion_of(arguments);
  const auto robot = load_shared_robot(arguments.card);
  const std::vector<std::string> files = find_robot_motions(arguments.inputs);
  const std::vector<std::string> outputs = converted_paths(files, arguments.output, options.to);
  std::vector<ConvertedMotion> made(files.size());
  Progress progress(session.progress());
  progress.start("converting", static_cast<int>(files.size()), "motions");
  parallel_for_each(static_cast<int>(files.size()), arguments.threads, [&](int i) {
    made[i] = convert_motion(files[i], outputs[i], *robot, options);
    progress.advance();
  });
  progress.finish();
  constexpr size_t kListed = 10;
  std::string text;
  nlohmann::json results = nlohmann::json::array();
  for (size_t i = 0; i < made.size(); ++i) {
    if (made.size() == 1)
      for (const std::string& sentence : made[i].evidence) text += "  " + sentence + "\n";
    if (i < kListed) text += fmt::format("{}: {} frames at {:g} Hz\n", made[i].file, made[i].frames, made[i].rate_hz);
    results.push_back({{"file", made[i].file},
                       {"source", files[i]},
                       {"frames", made[i].frames},
                       {"rate_hz", made[i].rate_hz},
                       {"evidence", made[i].evidence}});
  }
  if (made.size() > kListed) text += fmt::format("... and {} more in {}\n", made.size() - kListed, arguments.output);
  print(session, text, {{"converted", results}});
}

}  // namespace

void add_convert(CLI::App& app, Session& session) {
  CLI::App* command = add_command(app, session, "convert", "robot motions into the formats of other tools",
                                  "duet convert paired --output gmr --to gmr\n"
                                  "  duet convert paired --output real --to paired --prepare sim-to-real");
  auto arguments = std::make_shared<ConvertArguments>();
  command->add_option("motions", arguments->inputs, "files of robot motions, or folders of them")->required();
  command->add_option("-o,--output", arguments->output, "folder, or a file for one motion")->required();
  command
      ->add_option("--to", arguments->to,
                   "format to write, of `duet list robot-formats`; paired: stays a paired motion")
      ->required();
  command->add_option_function<double>(
      "--rate", [arguments](double v) { arguments->rate_hz = v; },
      "frames per second of what is written (default: the motion's, or the format's where its files hold none)");
  command->add_option(
      "--order", arguments->order,
      "of joints and bodies in beyondmimic: breadth-first (IsaacLab, the default) or depth-first (mjlab)");
  command->add_option("--prepare", arguments->prepare,
                      "sim-to-real: Algorithm 7 on paired motions (neutral, straight preparation; still follow-up)");
  command->add_option("--card", arguments->card, "robot card by name or path (default: the G1)");
  command->add_option_function<double>(
      "--source-rate", [arguments](double v) { arguments->reading.options.rate_hz = v; },
      "frames per second of what is read (default: the file's)");
  command->add_option_function<double>(
      "--units", [arguments](double v) { arguments->reading.options.metres = v; },
      "metres per unit of what is read (default: detected)");
  command->add_option("--format", arguments->format,
                      "format that is read, of `duet list robot-formats` (default: by its content)");
  add_robot_motion_options(*command, arguments->reading);
  add_threads(command, arguments->threads);
  command->callback([&session, arguments] { run_convert(session, *arguments); });
}

}  // namespace duet::cli
