#include "duet/training/distill.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "duet/core/require.h"
#include "duet/training/agent.h"
#include "duet/training/threads.h"

namespace duet {
namespace {

using Eigen::MatrixXf;
using Eigen::VectorXf;

constexpr const char* kStudentFormat = "duet.wbc-student/1";

template <typename Vector>
void disturb(Vector& values, double half_range, Random& random) {
  for (Eigen::Index i = 0; i < values.size(); ++i) values[i] += random.uniform(-half_range, half_range);
}

void disturb(WbcSensors& sensors, const SensorNoise& noise, Random& random) {
  disturb(sensors.q, noise.q, random);
  disturb(sensors.v, noise.v, random);
  disturb(sensors.w, noise.w, random);
  disturb(sensors.gravity, noise.gravity, random);
  disturb(sensors.q_ref, noise.reference, random);
  disturb(sensors.root_error, noise.reference, random);
}

}  // namespace

struct Distillation::Worker {
  struct Student {
    WbcObserver observer;
    WbcSensors sensors;
    bool begins = true;
  };
  std::vector<WbcEnvironment> environments;
  std::vector<Student> students;
  BatchMlp teacher, student;
  Random random;
  MatrixXf clean, critic, seen, input, teacher_input;
  MatrixXf batch_input, batch_target, difference;
  Normaliser moments;
  IterationReport sums;
  double loss = 0.0;

  Worker(const WbcAgent& agent, const Mlp& mlp, std::uint64_t seed, int thread, long round)
      : teacher(agent.actor),
        student(mlp),
        random(seed, stream_key({"distil", std::to_string(thread), std::to_string(round)})) {}
};

StudentState make_student(int joints, std::uint64_t seed) {
  Random random(seed, stream_key({"student weights"}));
  const int inputs = WbcLayout(joints).student();
  StudentState state;
  state.student = random_mlp({inputs, 512, 256, 128, joints}, 0.1F, random);
  state.input = Normaliser(inputs);
  state.seed = seed;
  return state;
}

SafeTensors to_tensors(const StudentState& state) {
  SafeTensors tensors;
  add_mlp(tensors, "student", state.student);
  add_normaliser(tensors, "input", state.input);
  add_adam(tensors, state.adam);
  tensors.metadata["format"] = kStudentFormat;
  tensors.metadata["round"] = std::to_string(state.round);
  tensors.metadata["steps"] = std::to_string(state.steps);
  tensors.metadata["minutes"] = fmt::format("{}", state.minutes);
  tensors.metadata["seed"] = std::to_string(state.seed);
  return tensors;
}

StudentState student_state(const SafeTensors& tensors, const std::string& file) {
  expect_text(tensors, "format", kStudentFormat, file);
  StudentState state;
  state.student = read_mlp(tensors, "student", file);
  state.input = normaliser_of(tensors, "input", state.student.inputs(), file);
  state.adam = adam_of(tensors, flat_views(state.student.layers), file);
  state.round = std::lround(number_of(tensors, "round", file));
  state.steps = std::lround(number_of(tensors, "steps", file));
  state.minutes = number_of(tensors, "minutes", file);
  state.seed = static_cast<std::uint64_t>(number_of(tensors, "seed", file));
  return state;
}

Distillation::Distillation(const std::shared_ptr<const RobotModel>& robot, const WbcTask& task,
                           const DistillOptions& options, WbcAgent teacher, StudentState state, long rounds)
    : options_(options), teacher_(std::move(teacher)), state_(std::move(state)), rounds_(rounds) {
  require(options.threads >= 1 && options.environments % options.threads == 0,
          "distillation: {} environments on {} threads, expected a multiple", options.environments, options.threads);
  const WbcLayout layout(robot->dof());
  require(teacher_.actor.inputs() == layout.oracle() && state_.student.inputs() == layout.student(),
          "distillation: an oracle of {} and a student of {} inputs, expected {} and {}", teacher_.actor.inputs(),
          state_.student.inputs(), layout.oracle(), layout.student());
  inputs_.resize(layout.student(), options.buffer);
  targets_.resize(robot->dof(), options.buffer);
  const int each = options.environments / options.threads;
  for (int t = 0; t < options.threads; ++t)
    workers_.push_back(std::make_unique<Worker>(teacher_, state_.student, state_.seed, t, state_.round));
  on_threads(options.threads, [&](int t) {
    Worker& worker = *workers_[t];
    for (int i = 0; i < each; ++i) {
      worker.environments.emplace_back(robot, task, state_.seed + 7000003ULL * static_cast<std::uint64_t>(state_.round),
                                       t * each + i);
      worker.environments.back().skip_to(worker.random.below(task.episode_ticks));
      worker.students.push_back({WbcObserver(WbcKind::kStudent, layout.joints()), {}, true});
    }
    worker.clean.resize(layout.oracle(), each);
    worker.critic.resize(worker.environments[0].critic_size(), each);
    worker.seen.resize(layout.student(), each);
  });
}

Distillation::~Distillation() = default;

IterationReport Distillation::iterate() {
  const auto begin = std::chrono::steady_clock::now();
  const int each = options_.environments / options_.threads, samples = options_.environments * options_.horizon;
  on_threads(options_.threads,
             [&](int t) { collect(t, state_.round < options_.warm_rounds, next_ + t * each * options_.horizon); });
  next_ = (next_ + samples) % options_.buffer;
  filled_ = std::min(options_.buffer, filled_ + samples);
  IterationReport report;
  for (const auto& worker : workers_) {
    // The statistics are those of the first rounds: a normaliser that moves would move what has been learnt.
    if (state_.round < 4L * options_.warm_rounds) state_.input.merge(worker->moments);
    report.episodes += worker->sums.episodes;
    report.falls += worker->sums.falls;
    for (WbcEnvironment& environment : worker->environments) report.tracking.add(environment.take_statistics());
  }
  const double done = std::min(1.0, static_cast<double>(state_.round) / static_cast<double>(std::max(1L, rounds_)));
  report.rate = options_.rate * std::pow(options_.last_rate / options_.rate, done);
  for (int b = 0; b < options_.batches; ++b) {
    report.loss += learn() / options_.batches;
    std::vector<Eigen::Map<VectorXf>> gradients = flat_views(workers_[0]->student.gradient());
    for (size_t t = 1; t < workers_.size(); ++t) {
      const auto others = flat_views(workers_[t]->student.gradient());
      for (size_t i = 0; i < others.size(); ++i) gradients[i] += others[i];
    }
    auto parameters = flat_views(state_.student.layers);
    state_.adam.step(parameters, gradients, report.rate, 1.0);
  }
  report.iteration = ++state_.round;
  report.steps = state_.steps += samples;
  state_.minutes += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() / 60.0;
  return report;
}

void Distillation::collect(int thread, bool teacher_acts, int first) {
  Worker& worker = *workers_[thread];
  const int each = static_cast<int>(worker.environments.size());
  worker.moments = Normaliser(static_cast<int>(worker.seen.rows()));
  worker.moments.count = 0.0;
  worker.sums = {};
  for (int h = 0; h < options_.horizon; ++h) {
    for (int i = 0; i < each; ++i) {
      const WbcEnvironment& environment = worker.environments[i];
      Worker::Student& student = worker.students[i];
      environment.observe(column(worker.clean, i), column(worker.critic, i));
      student.sensors = environment.sensors();
      disturb(student.sensors, options_.noise, worker.random);
      if (student.begins) student.observer.reset();
      student.begins = false;
      std::ranges::copy(student.observer.update(student.sensors, environment.action()), column(worker.seen, i).begin());
    }
    worker.moments.update(worker.seen);
    worker.teacher_input = worker.clean;
    teacher_.actor_input.apply(worker.teacher_input);
    const MatrixXf& wanted = worker.teacher.forward(worker.teacher_input);
    const int slot = (first + h * each) % options_.buffer;
    inputs_.middleCols(slot, each) = worker.seen;
    targets_.middleCols(slot, each) = wanted;
    worker.input = worker.seen;
    state_.input.apply(worker.input);
    const MatrixXf& done = teacher_acts ? wanted : worker.student.forward(worker.input);
    for (int i = 0; i < each; ++i) {
      WbcEnvironment& environment = worker.environments[i];
      const Transition transition = environment.step({done.col(i).data(), static_cast<size_t>(done.rows())});
      if (transition.end == EpisodeEnd::kNone) continue;
      ++worker.sums.episodes;
      worker.sums.falls += transition.end == EpisodeEnd::kFell ? 1 : 0;
      environment.reset();
      worker.students[i].begins = true;
    }
  }
}

double Distillation::learn() {
  const int share = options_.batch / options_.threads;
  on_threads(options_.threads, [&](int t) {
    Worker& worker = *workers_[t];
    worker.batch_input.resize(inputs_.rows(), share);
    worker.batch_target.resize(targets_.rows(), share);
    for (int i = 0; i < share; ++i) {
      const int sample = worker.random.below(filled_);
      worker.batch_input.col(i) = inputs_.col(sample);
      worker.batch_target.col(i) = targets_.col(sample);
    }
    state_.input.apply(worker.batch_input);
    worker.difference = worker.student.forward(worker.batch_input) - worker.batch_target;
    worker.loss = worker.difference.squaredNorm();
    worker.difference *= 2.0F / static_cast<float>(share * options_.threads);
    worker.student.backward(worker.difference);
  });
  double loss = 0.0;
  for (const auto& worker : workers_) loss += worker->loss;
  return loss / static_cast<double>(share * options_.threads * targets_.rows());
}

}  // namespace duet
