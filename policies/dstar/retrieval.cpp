#include "duet/policies/dstar/retrieval.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "duet/core/field.h"
#include "duet/core/json.h"
#include "duet/core/recording.h"
#include "duet/core/require.h"
#include "duet/core/share.h"
#include "duet/nn/safetensors.h"

namespace duet {
namespace {

constexpr const char* kRetrievalFormat = "duet.retrieval/1";
constexpr int kJointPositions = 84, kUpperJoints = 12;  // channels of q; the first that is no leg's
constexpr std::array<int, 5> kPoints = {kHead, kLeftElbow, kRightElbow, kLeftHand, kRightHand};

int channel_of(int smpl) { return 3 + 3 * smpl; }

// A file has tasks as their places among the supplement's.
std::vector<Task> tasks_of_windows(const RetrievalLibrary& library) {
  std::vector<Task> tasks;
  for (const Task task : kPaperTasks)
    if (std::ranges::find(library.tasks, task.index()) != library.tasks.end()) tasks.push_back(task);
  return tasks;
}

class RetrievalPolicy final : public Policy {
 public:
  RetrievalPolicy(std::shared_ptr<const RobotModel> robot, std::shared_ptr<const RetrievalLibrary> library)
      : robot_(std::move(robot)), library_(std::move(library)), maker_(robot_), key_(kRetrievalKey) {}

  [[nodiscard]] std::string_view name() const override { return "retrieval"; }

  void reset(const EpisodeContext& context) override {
    require_known_task(name(), tasks_of_windows(*library_), context.task);
    task_ = context.task.index();
    faults_ = {};
  }

  Anchors act(const Observation& observation) override {
    maker_.make(observation, features_);
    write_key(features_, key_);
    key_ = (key_ - library_->mean).cwiseQuotient(library_->deviation);
    const int found = nearest_window(*library_, task_, key_);
    return decode_plan({library_->plans.col(found).data(), kPlanSize}, ego_frame(observation.now().robot), *robot_);
  }

  // No window is near to what is not a number.
  std::vector<Reference> plan(const Observation& observation) override {
    if (is_finite(observation)) return Policy::plan(observation);
    return leave_out(faults_, name(), observation.tick, "the observation is not finite");
  }

  [[nodiscard]] PolicyFaults faults() const override { return faults_; }

 private:
  std::shared_ptr<const RobotModel> robot_;
  std::shared_ptr<const RetrievalLibrary> library_;
  FeatureMaker maker_;
  DstarFeatures features_;
  Eigen::VectorXf key_;
  int task_ = 0;
  PolicyFaults faults_;
};

void check_metadata(const SafeTensors& file, const RobotModel& robot, const std::string& path) {
  expect_text(file, "format", kRetrievalFormat, path);
  require_made_for(text_of(file, "robot", path), robot, path);
  expect_text(file, "joints", dumped(nlohmann::json(robot.joint_names())), path);
}

std::vector<int> tasks_of(const SafeTensors& file, const std::string& path) {
  const std::vector<float>& values = tensor_named(file, "tasks", path).values;
  std::vector<int> tasks;
  tasks.reserve(values.size());
  for (const float value : values) {
    if (value < 0.0F || value >= static_cast<float>(kPaperTasks.size()) || value != std::floor(value))
      throw InputError(
          fmt::format("{}: tensor 'tasks': expected 0 to {}, found {}", path, kPaperTasks.size() - 1, value));
    tasks.push_back(static_cast<int>(value));
  }
  return tasks;
}

}  // namespace

void write_key(const DstarFeatures& features, Eigen::Ref<Eigen::VectorXf> key) {
  const auto now = features.frames.col(kHistoryFrames - 1), before = features.frames.col(0);
  Eigen::Index at = 0;
  const auto put = [&](const auto& part) {
    key.segment(at, part.size()) = part;
    at += part.size();
  };
  put(now.head<3>());
  for (const int point : kPoints) put(now.segment<3>(channel_of(point)));
  put(now.segment<17>(kJointPositions + kUpperJoints));
  put(now.head<3>() - before.head<3>());
  for (const int hand : {kLeftHand, kRightHand})
    put(now.segment<3>(channel_of(hand)) - before.segment<3>(channel_of(hand)));
  put(features.distance);
}

int nearest_window(const RetrievalLibrary& library, int task, const Eigen::Ref<const Eigen::VectorXf>& key) {
  int nearest = -1;
  float least = std::numeric_limits<float>::infinity();
  for (int i = 0; i < library.windows(); ++i) {
    if (library.tasks[i] != task) continue;
    const float distance = (library.keys.col(i) - key).squaredNorm();
    if (distance >= least) continue;
    least = distance;
    nearest = i;
  }
  return nearest;
}

void save_retrieval_library(const std::string& path, const RetrievalLibrary& library) {
  SafeTensors file;
  file.metadata = {
      {"format", kRetrievalFormat}, {"robot", library.robot}, {"joints", dumped(nlohmann::json(library.joints))}};
  file.tensors["keys"] = columns_tensor(library.keys);
  file.tensors["plans"] = columns_tensor(library.plans);
  file.tensors["mean"] = columns_tensor(library.mean);
  file.tensors["deviation"] = columns_tensor(library.deviation);
  file.tensors["tasks"] = {{library.windows()}, {library.tasks.begin(), library.tasks.end()}};
  write_safetensors(path, file, TensorType::kF16);
}

std::shared_ptr<const RetrievalLibrary> load_retrieval_library(const std::string& path, const RobotModel& robot) {
  const SafeTensors file = read_safetensors(path);
  check_metadata(file, robot, path);
  auto library = std::make_shared<RetrievalLibrary>();
  library->robot = robot.name;
  library->joints = robot.joint_names();
  library->tasks = tasks_of(file, path);
  library->mean = columns_of(file, "mean", kRetrievalKey, 1, path);
  library->deviation = columns_of(file, "deviation", kRetrievalKey, 1, path);
  library->keys = columns_of(file, "keys", kRetrievalKey, library->windows(), path);
  library->plans = columns_of(file, "plans", kPlanSize, library->windows(), path);
  return library;
}

namespace {

struct RetrievalOptions {
  std::string library;  // "": the one that ships
};

const FieldTable<RetrievalOptions>& retrieval_options() {
  static const FieldTable<RetrievalOptions> table = {field<RetrievalOptions>(
      {.name = "library", .meaning = "file of windows, made by `duet train retrieval`"}, &RetrievalOptions::library)};
  return table;
}

}  // namespace

PolicyInfo retrieval_info(const std::string& name) {
  return {name, "The plan of the most similar moment of the demonstrations (nearest neighbour)",
          option_list<PolicyOption>(retrieval_options(), {.library = "policies/dstar/retrieval.safetensors"})};
}

LoadedFiles retrieval_files(const std::string& name, const PolicyOptions& given) {
  const char* what = "library of 'retrieval' (option `library`)";
  const RetrievalOptions options = read_options("policy", name, retrieval_options(), given);
  return {{"library", options.library.empty() ? share_file(what, "policies/dstar/retrieval.safetensors")
                                              : first_existing(what, {options.library})}};
}

PolicyMaker retrieval_maker(const std::string& name, std::shared_ptr<const RobotModel> robot,
                            const PolicyOptions& options) {
  require(robot != nullptr, "policy '{}' needs a robot", name);
  const auto library = load_retrieval_library(retrieval_files(name, options).front().path, *robot);
  return [robot = std::move(robot), library] { return std::make_unique<RetrievalPolicy>(robot, library); };
}

}  // namespace duet
