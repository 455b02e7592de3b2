// The student of A.3.2: it acts on noisy observations with ten frames of history and learns to do what the oracle would
// do on the clean ones (DAgger: Ross et al., AISTATS 2011; loss: mean squared difference of the action means).
// Reproducible from the seed for the same number of threads.
#pragma once

#include <memory>
#include <vector>

#include "duet/training/agent.h"
#include "duet/training/wbc_environment.h"

namespace duet {

// Half ranges of the uniform noise of Table S3, which gives them by symbol alone (docs/deviations.md).
struct SensorNoise {
  double q = 0.01;  // [rad]
  double v = 0.5;   // [rad/s]
  double w = 0.2;   // [rad/s]
  double gravity = 0.05;
  double reference = 0.02;  // of u_t: joints [rad], root error [m]
};

struct DistillOptions {
  int threads = 2;
  int environments = 128;         // a multiple of threads
  int horizon = 16;               // ticks per environment and round
  int buffer = 65536;             // samples that are learnt from
  int batches = 6, batch = 1024;  // per round
  int warm_rounds = 5;            // in which the oracle acts
  double rate = 1e-3, last_rate = 5e-5;
  SensorNoise noise;
};

struct StudentState {
  Mlp student;
  Normaliser input;
  Adam adam;
  long round = 0, steps = 0;
  double minutes = 0.0;
  std::uint64_t seed = 0;
};

StudentState make_student(int joints, std::uint64_t seed);
SafeTensors to_tensors(const StudentState& state);
StudentState student_state(const SafeTensors& tensors, const std::string& file);

class Distillation {
 public:
  // `rounds`: after how many the learning rate has reached its last value.
  Distillation(const std::shared_ptr<const RobotModel>& robot, const WbcTask& task, const DistillOptions& options,
               WbcAgent teacher, StudentState state, long rounds);
  ~Distillation();  // where Worker is complete
  IterationReport iterate();
  [[nodiscard]] const StudentState& state() const { return state_; }

 private:
  struct Worker;
  void collect(int thread, bool teacher_acts, int first);
  double learn();

  DistillOptions options_;
  WbcAgent teacher_;
  StudentState state_;
  long rounds_;
  std::vector<std::unique_ptr<Worker>> workers_;
  Eigen::MatrixXf inputs_, targets_;  // the buffer, a ring; columns are samples
  int filled_ = 0, next_ = 0;
};

}  // namespace duet
