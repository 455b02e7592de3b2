// duet hw see: recorded estimates of one person into guard and policy, and what the robot would do beside them.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/hardware/episodes/seen_person.h"
#include "duet/hardware/guard/camera_calibration.h"
#include "duet/parts/robot/hw.h"
#include "duet/people/video_person.h"
#include "duet/policies/catalogue/registry.h"
#include "duet/robots/robot_cards.h"
#include "duet/rows/json_fields.h"

namespace duet::cli {
namespace {

struct SeeArguments {
  std::string file, config, policy = "dstar", body_model, output;
  std::vector<std::string> tasks;
  double latency = 0.0, focal = 0.0, assumed_focal = 0.0, rate = 0.0;
  std::uint64_t seed = 1;
};

std::vector<RecordedEstimate> estimates_of(const VideoPerson& person, double latency) {
  std::vector<RecordedEstimate> log;
  for (int t = 0; t < person.joints.frames(); ++t) {
    PersonEstimate estimate;
    estimate.sequence = static_cast<std::uint64_t>(t) + 1;
    estimate.stamp = t / person.rate_hz;
    estimate.seen = person.seen[static_cast<std::size_t>(t)];
    estimate.joints = person.joints.frame(t);
    estimate.latency = latency;
    log.push_back(recorded(estimate));
  }
  return log;
}

std::vector<RecordedEstimate> read_estimates(Session& session, const SeeArguments& arguments) {
  if ((arguments.focal > 0.0) != (arguments.assumed_focal > 0.0))
    throw InputError("--focal-length and --assumed-focal-length: expected both or none of them, found one");
  if (!is_video_person(arguments.file)) return read_person_log(arguments.file);
  VideoPersonOptions options;
  options.body_model = arguments.body_model;
  if (arguments.rate > 0.0) options.rate_hz = arguments.rate;
  if (arguments.focal > 0.0) options.depth_scale = arguments.focal / arguments.assumed_focal;
  const VideoPerson person = read_video_person(arguments.file, options);
  note(session, person.evidence);
  return estimates_of(person, arguments.latency);
}

nlohmann::json counts_json(const PersonCounts& counts) {
  nlohmann::json json = nlohmann::json::object();
  for (std::size_t k = 0; k < kPersonFaults; ++k) json[estimate_name(k)] = counts[k];
  return json;
}

nlohmann::json seen_json(const SeenTask& seen) {
  nlohmann::json clamps = nlohmann::json::object();
  for (std::size_t k = 0; k < kClampReasons; ++k) clamps[std::string(kClampNames[k])] = seen.clamps[k];
  nlohmann::json json = {{"task", to_string(seen.task)},
                         {"ran", seen.ran},
                         {"message", seen.message},
                         {"estimates", counts_json(seen.estimates)},
                         {"seconds", seen.ticks * kTick}};
  if (!seen.ran) return json;
  json["outcome"] = to_string(seen.outcome);
  json["begins_at"] = seen.begins_at ? nlohmann::json(*seen.begins_at) : nlohmann::json();
  json["nearest_hands"] = number_or_null(seen.nearest);
  json["nearest_at"] = seen.nearest_at;
  json["walked"] = seen.walked;
  json["held_seconds"] = seen.held_ticks * kTick;
  json["untracked_seconds"] = seen.unseen_ticks * kTick;
  json["clamps"] = clamps;
  return json;
}

std::string seen_row(const SeenTask& seen) {
  if (!seen.ran) return fmt::format("{:<10} does not run: {}", to_string(seen.task), seen.message);
  return fmt::format("{:<10} {:>9} {:>7.2f} m at {:>5.1f} s {:>7.2f} m {:>7.2f} s {:>9.2f} s  {}{}",
                     to_string(seen.task), seen.begins_at ? fmt::format("{:.2f} s", *seen.begins_at) : "never",
                     seen.nearest, seen.nearest_at, seen.walked, seen.held_ticks * kTick, seen.unseen_ticks * kTick,
                     to_string(seen.outcome), seen.message.empty() ? "" : " (" + seen.message + ")");
}

void run_see(Session& session, const SeeArguments& arguments) {
  SeenOptions options{.config = read_robot_config(arguments.config), .seed = arguments.seed};
  if (!options.config.has_camera)
    throw InputError(
        fmt::format("{}: expected a 'camera', which says where the estimates are from, found none", arguments.config));
  std::vector<Task> tasks;
  for (const std::string& name : arguments.tasks) tasks.push_back(parse_task(name));
  if (tasks.empty()) tasks.assign(kPaperTasks.begin(), kPaperTasks.end());
  const std::vector<RecordedEstimate> estimates = read_estimates(session, arguments);
  if (!arguments.output.empty()) write_file(arguments.output, person_log(estimates));
  const PersonCounts counts = counts_of(estimates);
  note(session, fmt::format("plays {} estimates ({:.2f} s) into the guard of '{}' and policy '{}': a dry run beside a "
                            "twin in this process, nothing is written to any robot",
                            estimates.size(), estimates.back().at, arguments.config, arguments.policy));
  std::string text = person_counts_text(counts) +
                     "\ntask          begins   nearest hands       walked     held "
                     "untracked  outcome";
  nlohmann::json rows = nlohmann::json::array();
  const std::shared_ptr<const RobotModel> robot = load_shared_robot();
  for (const Task task : tasks) {
    const std::unique_ptr<Policy> policy = make_policy(arguments.policy, robot);
    const SeenTask seen = see_person(estimates, options, *policy, task);
    text += "\n" + seen_row(seen);
    if (seen.ran && refused_estimates(seen.estimates) > 0)
      text += fmt::format("\n           {}", person_counts_text(seen.estimates));
    rows.push_back(seen_json(seen));
    if (!seen.ran || seen.outcome == Outcome::kError) session.exit_code = kExitErrors;
  }
  print(session, text,
        {{"file", arguments.file},
         {"estimates", counts_json(counts)},
         {"seconds", estimates.back().at},
         {"policy", arguments.policy},
         {"tasks", rows}});
}

}  // namespace

namespace {

struct CalibrateArguments {
  std::string file, config;
  double most = 0.1;
};

nlohmann::json list_json(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

std::string camera_yaml(const Pose& X_BC) {
  const Eigen::Vector3d& p = X_BC.p;
  const Eigen::Quaterniond& R = X_BC.R;
  return fmt::format("camera:\n  position: [{:.4f}, {:.4f}, {:.4f}]\n  quat_wxyz: [{:.7f}, {:.7f}, {:.7f}, {:.7f}]",
                     p.x(), p.y(), p.z(), R.w(), R.x(), R.y(), R.z());
}

std::string calibration_text(const CameraCalibration& found, std::span<const MarkedPlace> places) {
  std::string text = camera_yaml(found.X_BC);
  text += fmt::format(
      "\nstandard errors: position {:.4f}, {:.4f}, {:.4f} m along x, y, z of the base; rotation {:.4f}, "
      "{:.4f}, {:.4f} rad about them",
      found.position_error.x(), found.position_error.y(), found.position_error.z(), found.rotation_error.x(),
      found.rotation_error.y(), found.rotation_error.z());
  text += fmt::format("\nresidual {:.4f} m (RMS of {} places); scale {:.3f}", found.rms, places.size(), found.scale);
  if (std::abs(found.scale - 1.0) > 0.05)
    text += ": the estimator's focal length is not the camera's, or the marks are not where the file has them";
  for (std::size_t k = 0; k < places.size(); ++k)
    text +=
        fmt::format("\n  place {} at {:.2f}, {:.2f} m: off by {:.4f} m; {} estimates, which scatter by {:.4f} m", k + 1,
                    places[k].p_BP.x(), places[k].p_BP.y(), found.residuals[k], places[k].estimates, places[k].moved);
  return text;
}

void run_calibrate(Session& session, const CalibrateArguments& arguments) {
  const std::vector<MarkedPlace> places = read_marked_places(arguments.file);
  const CameraCalibration found = calibrate_camera(places, arguments.file);
  std::string text = calibration_text(found, places);
  const Eigen::Quaterniond& R = found.X_BC.R;
  nlohmann::json json = {{"position", list_json(found.X_BC.p)},
                         {"quat_wxyz", {R.w(), R.x(), R.y(), R.z()}},
                         {"position_error", list_json(found.position_error)},
                         {"rotation_error", list_json(found.rotation_error)},
                         {"rms", found.rms},
                         {"residuals", found.residuals},
                         {"scale", number_or_null(found.scale)}};
  if (!arguments.config.empty()) {
    const Pose& X_BC = read_robot_config(arguments.config).camera.X_BC;
    const double apart = (X_BC.p - found.X_BC.p).norm(), turned = X_BC.R.angularDistance(R);
    text += fmt::format("\n{}: its camera is {:.4f} m and {:.4f} rad away from this", arguments.config, apart, turned);
    json["from_config"] = {{"distance", apart}, {"angle", turned}};
  }
  const bool good = found.rms <= arguments.most;
  if (!good) text += fmt::format("\nnot good: expected a residual of at most {} m", arguments.most);
  json["good"] = good;
  print(session, text, json);
  if (!good) session.exit_code = kExitGate;
}

}  // namespace

void add_calibrate(CLI::App& hardware, Session& session) {
  CLI::App* command =
      add_command(hardware, session, "calibrate", "the camera on the body, from a person at marked places",
                  "duet hw calibrate places.yaml --config examples/hardware/camera.yaml");
  const auto arguments = std::make_shared<CalibrateArguments>();
  command->add_option("file", arguments->file, "where somebody stood when (YAML; docs/hardware.md, \"Calibration\")")
      ->required();
  command->add_option("--config", arguments->config, "configuration of the robot: how far its 'camera' is from this");
  command->add_option("--most", arguments->most, "residual that is still good [m]; a larger one exits with 1")
      ->capture_default_str()
      ->check(CLI::Range(0.001, 1.0));
  command->callback([&session, arguments] { run_calibrate(session, *arguments); });
}

void add_see(CLI::App& hardware, Session& session) {
  CLI::App* command =
      add_command(hardware, session, "see", "what the robot would do beside recorded estimates of a person",
                  "duet hw see person.dpj --config examples/hardware/camera.yaml --task handshake");
  const auto arguments = std::make_shared<SeeArguments>();
  command
      ->add_option(
          "file", arguments->file,
          "messages of an estimator one after another, or a file of 4D-Humans with PHALP (.pkl) or GVHMR (.pt)")
      ->required();
  command->add_option("--config", arguments->config, "configuration of the robot, with its 'camera'")->required();
  command
      ->add_option("--task", arguments->tasks,
                   "that the policy is told (may be given again); without: the six of the paper")
      ->allow_extra_args(false);
  command->add_option("--policy", arguments->policy, "that sees the person")->capture_default_str();
  command->add_option("--body-model", arguments->body_model, "of a video's file: SMPL, SMPL-H or SMPL-X (yours)");
  command->add_option("--focal-length", arguments->focal, "of the camera [px]: of a video's file, scales the depth")
      ->check(CLI::Range(1.0, 1e6));
  command->add_option("--assumed-focal-length", arguments->assumed_focal, "that the estimator took [px]")
      ->check(CLI::Range(1.0, 1e6));
  command->add_option("--rate", arguments->rate, "of the video [Hz]; without: 30")->check(CLI::Range(1.0, 1000.0));
  command->add_option("--latency", arguments->latency, "that a video's estimates would have had [s]")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 0.25));
  command->add_option("--seed", arguments->seed, "of twin and policy")->capture_default_str();
  command->add_option("-o,--output", arguments->output, "file for the messages that were played");
  command->callback([&session, arguments] { run_see(session, *arguments); });
}

}  // namespace duet::cli
