// The baseline that only remembers: the plan that was made in the demonstration most like what is seen now, of the same
// task. Nearest neighbour over a library of windows; no network.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "duet/core/file.h"
#include "duet/nn/safetensors.h"
#include "duet/policies/dstar/features.h"
#include "duet/policies/policy.h"

namespace duet {

// Partner's root (3), head, elbows and hands (15), the robot's upper joints (17), how partner's root and hands moved
// over the history (9), the six relations' distances (6).
inline constexpr int kRetrievalKey = 50;

struct RetrievalLibrary {
  std::string robot;                // name of the card
  std::vector<std::string> joints;  // order of every joint vector
  std::vector<int> tasks;           // per window: place in kPaperTasks
  Eigen::VectorXf mean, deviation;  // of keys
  Eigen::MatrixXf keys;             // (kRetrievalKey, windows), normalised
  Eigen::MatrixXf plans;            // (kPlanSize, windows), as encode_plan has them

  [[nodiscard]] int windows() const { return static_cast<int>(tasks.size()); }
};

void write_key(const DstarFeatures& features, Eigen::Ref<Eigen::VectorXf> key);

// Index of the nearest window of a task; -1 where the library has none of it.
int nearest_window(const RetrievalLibrary& library, int task, const Eigen::Ref<const Eigen::VectorXf>& key);

// Throw InputError (file, what, expected, found): not a library, another robot or joints, sizes.
void save_retrieval_library(const std::string& path, const RetrievalLibrary& library);
std::shared_ptr<const RetrievalLibrary> load_retrieval_library(const std::string& path, const RobotModel& robot);

PolicyInfo retrieval_info(const std::string& name);  // option `library`
PolicyMaker retrieval_maker(const std::string& name, std::shared_ptr<const RobotModel> robot,
                            const PolicyOptions& options);
LoadedFiles retrieval_files(const std::string& name, const PolicyOptions& options);

}  // namespace duet
