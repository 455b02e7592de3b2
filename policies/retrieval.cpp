#include "policies/retrieval.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "core/require.h"
#include "core/share.h"
#include "core/skeleton.h"

namespace duet {
namespace {

constexpr const char* kFormat = "duet.retrieval/1";
constexpr int kJointPositions = 84, kUpperJoints = 12;  // channels of q; the first that is no leg's
constexpr std::array<int, 5> kPoints = {kHead, kLeftElbow, kRightElbow, kLeftHand, kRightHand};

int channel_of(int smpl) { return 3 + 3 * smpl; }

class RetrievalPolicy final : public Policy {
 public:
  RetrievalPolicy(std::shared_ptr<const RobotModel> robot, std::shared_ptr<const RetrievalLibrary> library)
      : robot_(std::move(robot)), library_(std::move(library)), maker_(robot_), key_(kRetrievalKey) {}

  [[nodiscard]] std::string_view name() const override { return "retrieval"; }

  void reset(const EpisodeContext& context) override {
    task_ = static_cast<int>(context.task);
    require(std::find(library_->tasks.begin(), library_->tasks.end(), task_) != library_->tasks.end(),
            fmt::format("the library of 'retrieval' has no window of task {}", to_string(context.task)));
  }

  Anchors act(const Observation& observation) override {
    maker_.make(observation, features_);
    write_key(features_, key_);
    key_ = (key_ - library_->mean).cwiseQuotient(library_->deviation);
    const int found = nearest_window(*library_, task_, key_);
    return decode_plan({library_->plans.col(found).data(), kPlanSize}, ego_frame(observation.now().robot), *robot_);
  }

 private:
  std::shared_ptr<const RobotModel> robot_;
  std::shared_ptr<const RetrievalLibrary> library_;
  FeatureMaker maker_;
  DstarFeatures features_;
  Eigen::VectorXf key_;
  int task_ = 0;
};

Tensor tensor_of(const Eigen::MatrixXf& matrix) {
  return {{matrix.cols(), matrix.rows()}, {matrix.data(), matrix.data() + matrix.size()}};
}

std::string text_of(const SafeTensors& file, const char* key, const std::string& path) {
  const auto found = file.metadata.find(key);
  if (found == file.metadata.end()) throw InputError(fmt::format("{}: metadata '{}' is missing", path, key));
  return found->second;
}

Eigen::MatrixXf matrix_of(const SafeTensors& file, const char* name, int rows, int columns, const std::string& path) {
  const auto found = file.tensors.find(name);
  if (found == file.tensors.end()) throw InputError(fmt::format("{}: tensor '{}' is missing", path, name));
  if (found->second.shape != std::vector<std::int64_t>{columns, rows})
    throw InputError(fmt::format("{}: tensor '{}': expected shape ({}, {}), found ({})", path, name, columns, rows,
                                 fmt::join(found->second.shape, ", ")));
  return Eigen::Map<const Eigen::MatrixXf>(found->second.values.data(), rows, columns);
}

void check_metadata(const SafeTensors& file, const RobotModel& robot, const std::string& path) {
  const auto expect = [&](const char* key, const std::string& expected) {
    const std::string found = text_of(file, key, path);
    if (found != expected)
      throw InputError(fmt::format("{}: {}: expected '{}', found '{}'", path, key, expected, found.substr(0, 200)));
  };
  expect("format", kFormat);
  expect("robot", robot.name);
  expect("joints", nlohmann::json(robot.joint_names()).dump());
}

std::vector<int> tasks_of(const SafeTensors& file, const std::string& path) {
  const auto found = file.tensors.find("tasks");
  if (found == file.tensors.end()) throw InputError(fmt::format("{}: tensor 'tasks' is missing", path));
  std::vector<int> tasks;
  tasks.reserve(found->second.values.size());
  for (const float value : found->second.values) {
    if (value < 0.0F || value >= static_cast<float>(kTasks.size()) || value != std::floor(value))
      throw InputError(fmt::format("{}: tensor 'tasks': expected 0 to {}, found {}", path, kTasks.size() - 1, value));
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
  file.metadata = {{"format", kFormat}, {"robot", library.robot}, {"joints", nlohmann::json(library.joints).dump()}};
  file.tensors["keys"] = tensor_of(library.keys);
  file.tensors["plans"] = tensor_of(library.plans);
  file.tensors["mean"] = tensor_of(library.mean);
  file.tensors["deviation"] = tensor_of(library.deviation);
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
  library->mean = matrix_of(file, "mean", kRetrievalKey, 1, path);
  library->deviation = matrix_of(file, "deviation", kRetrievalKey, 1, path);
  library->keys = matrix_of(file, "keys", kRetrievalKey, library->windows(), path);
  library->plans = matrix_of(file, "plans", kPlanSize, library->windows(), path);
  return library;
}

PolicyInfo retrieval_info(const std::string& name) {
  return {name,
          "The plan of the most similar moment of the demonstrations (nearest neighbour)",
          {{"library", "policies/dstar/retrieval.safetensors", "file of windows, made by `duet train retrieval`"}}};
}

PolicyMaker retrieval_maker(const std::string& name, std::shared_ptr<const RobotModel> robot,
                            const PolicyOptions& options) {
  require(robot != nullptr, fmt::format("policy '{}' needs a robot", name));
  const auto given = options.find("library");
  const std::string path = given != options.end() ? given->second
                                                  : share_file("library of 'retrieval' (option `library`)",
                                                               "policies/dstar/retrieval.safetensors");
  const auto library = load_retrieval_library(path, *robot);
  return [robot = std::move(robot), library] { return std::make_unique<RetrievalPolicy>(robot, library); };
}

}  // namespace duet
