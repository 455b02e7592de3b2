// Windows of D-STAR's training (A.3.1): 12 frames of observation, five anchors, the phase, what the partner will do;
// with the disturbances that make a policy robust: the robot is not where the demonstration has it, the partner is seen
// through noise.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "duet/core/numbers.h"
#include "duet/policies/dstar/features.h"
#include "duet/policies/dstar/retrieval.h"
#include "duet/training/dstar/demonstrations.h"

namespace duet {

struct WindowOptions {
  int stride = 25;         // of windows in an epoch; each is moved by up to it at random
  double root = 0.06;      // deviation of the robot's place [m]; of two windows in three
  double heading = 0.08;   // [rad]
  double tilt = 0.05;      // of its roll and pitch [rad]: what it leans is not what it means
  double astray = 0.8;     // the robot up to so far from where it should be [m]; of every fourth window
  double turned = 0.5;     // and turned by so much [rad]
  double joints = 0.03;    // of all joints at once, and a fifth of it per frame [rad]
  double rates = 0.15;     // of joint rates [rad/s]
  double jitter = 0.04;    // largest deviation of the partner's joints [m]; of every second window
  double misplaced = 1.3;  // largest share of what a tracker misplaces joints by (windows.cpp); of two windows in three
  double dropout = 0.2;    // largest share of joints that are not seen; of every third window
  int long_stride = 1;     // of the network's configuration
  bool augment = true;
  // A robot that has gone astray is not asked to be back at once: the root of anchor k is at most so far from it.
  // It leads no faster than WBC-Sim follows.
  double reach = 0.1, speed = 0.5;           // [m], and [m/s] times its 0.5 k s
  double turn_reach = 0.3, turn_rate = 0.8;  // [rad], [rad/s]
};

// The commands of a task that training uses: its prompt, paraphrases, and with `leads` each of them for one who begins.
std::vector<std::string> commands_of(Task task, bool leads);

// Keypoints whose places L_pos and L_spatial compare: of the robot and of the partner.
inline constexpr int kLossPoints = 7;  // head, shoulders, elbows, hands
std::vector<int> loss_frames(const RobotModel& robot);
const std::array<int, kLossPoints>& loss_joints();  // of SMPL

struct Window {
  int demonstration = 0, frame = 0;  // frame of the demonstration
};

// Plain arrays, a window per column, ready for a trainer.
struct WindowBatch {
  int size = 0;
  Eigen::MatrixXf frames, past;  // (149 * 12, size): as DstarFeatures has them
  Eigen::MatrixXf position, distance, orientation;
  Eigen::MatrixXf plan;           // (180, size): encode_plan
  Eigen::MatrixXf partner;        // (kAnchors * kLossPoints * 3, size): where the partner's points will be, in E
  std::vector<int> phase;         // 0, 1, 2
  std::vector<int> task, prompt;  // prompt: index into commands_of
  void resize(int windows);
};

// Every window of a set at the options' stride.
std::vector<Window> list_windows(const DemonstrationSet& set, const WindowOptions& options);

// Fills batches; keeps buffers. One owner, not thread-safe.
class WindowMaker {
 public:
  WindowMaker(std::shared_ptr<const RobotModel> robot, const DemonstrationSet& set, const WindowOptions& options);
  // Column `column` of the batch; the same random numbers give the same bits.
  void make(const Window& window, Random& random, WindowBatch& batch, int column);

 private:
  void look(const Demonstration& entry, int frame, Random& random);
  void misplace(const Demonstration& entry, int frame, Random& random);
  void blur(Random& random);
  void displace(Random& random);

  std::shared_ptr<const RobotModel> robot_;
  const DemonstrationSet& set_;
  WindowOptions options_;
  FeatureMaker features_;
  std::array<ObservationFrame, kHistoryFrames> history_, past_;
  DstarFeatures made_;
};

// Fills a batch with windows drawn evenly from a list.
void draw_windows(WindowMaker& maker, const std::vector<Window>& windows, Random& random, WindowBatch& batch);

// The features of a window as the network saw them.
DstarFeatures features_of(const WindowBatch& batch, int column);

// Mean and deviation per channel of frames and plans over a sample of windows, as a network keeps them. Deviations are
// at least `floor`.
struct WindowStatistics {
  Eigen::VectorXf frame_mean, frame_deviation, plan_mean, plan_deviation;
};
WindowStatistics window_statistics(WindowMaker& maker, const std::vector<Window>& windows, std::uint64_t seed);

// The library of `retrieval`: windows of demonstrations as they are.

// `windows` of them, drawn evenly from the set. Throws std::invalid_argument for a set without a window.
RetrievalLibrary make_retrieval_library(const std::shared_ptr<const RobotModel>& robot, const DemonstrationSet& set,
                                        int windows, std::uint64_t seed);

}  // namespace duet
