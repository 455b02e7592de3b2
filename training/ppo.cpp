#include "duet/training/ppo.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numeric>

#include "duet/core/require.h"
#include "duet/core/robot_state.h"
#include "duet/training/threads.h"

namespace duet {
namespace {

using Clock = std::chrono::steady_clock;
using Eigen::MatrixXf;
using Eigen::VectorXf;

double seconds_since(Clock::time_point begin) { return std::chrono::duration<double>(Clock::now() - begin).count(); }

void mirror_columns(const Mirror& mirror, const MatrixXf& x, MatrixXf& y) {
  y.resize(x.rows(), x.cols());
  const auto rows = static_cast<size_t>(x.rows());
  for (Eigen::Index c = 0; c < x.cols(); ++c) mirror.apply({x.col(c).data(), rows}, {y.col(c).data(), rows});
}

}  // namespace

// Columns: (tick * threads + thread) * environments of a thread + environment. The second of a pair is the mirrored
// one.
struct Ppo::Batch {
  std::array<MatrixXf, 2> actor, critic, action, mean;
  std::array<VectorXf, 2> log_probability;
  VectorXf value, reward, advantage, target;
  std::vector<EpisodeEnd> end;

  Batch(int actor_size, int critic_size, int actions, int samples) {
    for (int m = 0; m < 2; ++m) {
      actor[m].resize(actor_size, samples);
      critic[m].resize(critic_size, samples);
      action[m].resize(actions, samples);
      mean[m].resize(actions, samples);
      log_probability[m].resize(samples);
    }
    for (VectorXf* values : {&value, &reward, &advantage, &target}) values->resize(samples);
    end.resize(samples);
  }
};

struct Ppo::Worker {
  std::vector<WbcEnvironment> environments;
  std::vector<double> returns;
  BatchMlp actor, critic;
  Normaliser actor_seen, critic_seen;
  Random noise;
  VectorXf log_std_gradient;
  IterationReport sums;
  std::array<MatrixXf, 2> actor_raw, critic_raw;  // as it is, mirrored
  MatrixXf actor_input, critic_input;
  MatrixXf actor_batch, critic_batch, mean_gradient, value_gradient;

  Worker(const WbcAgent& agent, std::uint64_t seed, int thread, long iteration)
      : actor(agent.actor),
        critic(agent.critic),
        noise(seed, stream_key({"ppo noise", std::to_string(thread), std::to_string(iteration)})) {}
};

Ppo::Ppo(const std::shared_ptr<const RobotModel>& robot, const WbcTask& task, const PpoOptions& options,
         TrainingState state)
    : options_(options),
      state_(std::move(state)),
      actor_mirror_(mirror_actor(*robot)),
      critic_mirror_(mirror_critic(*robot, robot->roles.bodies)),
      action_mirror_(mirror_joints(*robot)) {
  require(options.threads >= 1 && options.environments % options.threads == 0,
          "ppo: {} environments on {} threads, expected a multiple", options.environments, options.threads);
  const int samples = options.environments * options.horizon;
  require(samples % (options.minibatches * options.threads) == 0,
          "ppo: {} samples in {} minibatches on {} threads, expected a multiple", samples, options.minibatches,
          options.threads);
  require(state_.agent.actor.inputs() == actor_mirror_.size() &&
              state_.agent.critic.inputs() == critic_mirror_.size() && state_.agent.actor.outputs() == robot->dof(),
          "ppo: networks of {} and {} inputs for a robot that needs {} and {}", state_.agent.actor.inputs(),
          state_.agent.critic.inputs(), actor_mirror_.size(), critic_mirror_.size());
  batch_ = std::make_unique<Batch>(actor_mirror_.size(), critic_mirror_.size(), robot->dof(), samples);
  const int each = options.environments / options.threads;
  for (int t = 0; t < options.threads; ++t)
    workers_.push_back(std::make_unique<Worker>(state_.agent, state_.seed, t, state_.iteration));
  on_threads(options.threads, [&](int t) {
    Worker& worker = *workers_[t];
    Random start(state_.seed, stream_key({"ppo start", std::to_string(t)}));
    for (int i = 0; i < each; ++i) {
      // A continued training has new environments: their streams carry the iteration.
      worker.environments.emplace_back(
          robot, task, state_.seed + 1000003ULL * static_cast<std::uint64_t>(state_.iteration), t * each + i);
      worker.environments.back().skip_to(start.below(task.episode_ticks));
    }
    worker.returns.assign(each, 0.0);
    worker.actor_raw[0].resize(actor_mirror_.size(), each);
    worker.critic_raw[0].resize(critic_mirror_.size(), each);
  });
}

Ppo::~Ppo() = default;

IterationReport Ppo::iterate() {
  const Clock::time_point begin = Clock::now();
  Batch& batch = *batch_;
  on_threads(options_.threads, [&](int t) {
    collect(t, batch);
    advantages(t, batch);
  });
  const double divergence = learn(batch);
  if (!critic_alone()) steer(divergence);
  IterationReport report = summary();
  report.divergence = divergence;
  report.iteration = ++state_.iteration;
  report.steps = state_.steps += batch.value.size();
  state_.minutes += seconds_since(begin) / 60.0;
  return report;
}

double Ppo::learn(Batch& batch) {
  const auto samples = static_cast<int>(batch.value.size());
  const float mean = batch.advantage.mean();
  const float deviation = std::sqrt((batch.advantage.array() - mean).square().mean()) + 1e-6F;
  batch.advantage = (batch.advantage.array() - mean) / deviation;

  Random shuffle(state_.seed, stream_key({"ppo shuffle", std::to_string(state_.iteration)}));
  std::vector<int> order(samples);
  std::iota(order.begin(), order.end(), 0);
  std::vector<std::uint8_t> mirrored(samples);
  double divergence = 0.0;
  const int size = samples / options_.minibatches;
  for (int epoch = 0; epoch < options_.epochs; ++epoch) {
    for (int i = samples - 1; i > 0; --i) std::swap(order[i], order[shuffle.below(i + 1)]);
    for (std::uint8_t& flag : mirrored) flag = shuffle.chance(0.5) ? 1 : 0;
    for (int m = 0; m < options_.minibatches; ++m) divergence = minibatch(order, mirrored, m * size, size, batch);
  }
  return divergence;
}

// Sums what the threads counted; their moments go into the normalisers.
IterationReport Ppo::summary() {
  IterationReport report;
  for (const auto& worker : workers_) {
    state_.agent.actor_input.merge(worker->actor_seen);
    state_.agent.critic_input.merge(worker->critic_seen);
    report.episodes += worker->sums.episodes;
    report.falls += worker->sums.falls;
    report.episode_seconds += worker->sums.episode_seconds;
    report.episode_return += worker->sums.episode_return;
    for (WbcEnvironment& environment : worker->environments) report.tracking.add(environment.take_statistics());
  }
  for (Normaliser* input : {&state_.agent.actor_input, &state_.agent.critic_input})
    input->count = std::min(input->count, kLongestMemory);
  const double episodes = std::max(1, report.episodes);
  report.episode_seconds /= episodes;
  report.episode_return /= episodes;
  report.rate = state_.rate;
  report.std = state_.agent.log_std.array().exp().mean();
  return report;
}

void Ppo::collect(int thread, Batch& batch) {
  Worker& worker = *workers_[thread];
  const int each = static_cast<int>(worker.environments.size());
  worker.actor_seen = Normaliser(state_.agent.actor.inputs());
  worker.critic_seen = Normaliser(state_.agent.critic.inputs());
  worker.actor_seen.count = worker.critic_seen.count = 0.0;
  worker.sums = {};
  for (int h = 0; h < options_.horizon; ++h) {
    const int first = (h * options_.threads + thread) * each;
    look(worker);
    decide(worker, first, batch);
    step(worker, first, batch);
  }
}

void Ppo::look(Worker& worker) const {
  for (size_t i = 0; i < worker.environments.size(); ++i)
    worker.environments[i].observe(column(worker.actor_raw[0], static_cast<int>(i)),
                                   column(worker.critic_raw[0], static_cast<int>(i)));
  mirror_columns(actor_mirror_, worker.actor_raw[0], worker.actor_raw[1]);
  mirror_columns(critic_mirror_, worker.critic_raw[0], worker.critic_raw[1]);
}

void Ppo::decide(Worker& worker, int first, Batch& batch) const {
  const WbcAgent& agent = state_.agent;
  const int each = static_cast<int>(worker.environments.size());
  const VectorXf std = agent.log_std.array().exp(), inverse_std = std.cwiseInverse();
  const float sum_log_std = agent.log_std.sum();
  for (int m = 0; m < 2; ++m) {
    worker.actor_seen.update(worker.actor_raw[m]);
    worker.critic_seen.update(worker.critic_raw[m]);
    worker.actor_input = worker.actor_raw[m];
    worker.critic_input = worker.critic_raw[m];
    agent.actor_input.apply(worker.actor_input);
    agent.critic_input.apply(worker.critic_input);
    batch.actor[m].middleCols(first, each) = worker.actor_input;
    batch.critic[m].middleCols(first, each) = worker.critic_input;
    batch.mean[m].middleCols(first, each) = worker.actor.forward(worker.actor_input);
    if (m == 0) batch.value.segment(first, each) = worker.critic.forward(worker.critic_input).row(0).transpose();
  }
  for (int c = first; c < first + each; ++c) {
    for (Eigen::Index k = 0; k < std.size(); ++k)
      batch.action[0](k, c) = batch.mean[0](k, c) + std[k] * static_cast<float>(worker.noise.normal());
    action_mirror_.apply(column(batch.action[0], c), column(batch.action[1], c));
    for (int m = 0; m < 2; ++m)
      batch.log_probability[m][c] =
          log_probability(inverse_std, sum_log_std, batch.action[m].col(c).data(), batch.mean[m].col(c).data());
  }
}

void Ppo::step(Worker& worker, int first, Batch& batch) const {
  for (size_t i = 0; i < worker.environments.size(); ++i) {
    const int c = first + static_cast<int>(i);
    WbcEnvironment& environment = worker.environments[i];
    const Transition transition = environment.step(column(batch.action[0], c));
    worker.returns[i] += transition.reward;
    batch.end[c] = transition.end;
    batch.reward[c] = static_cast<float>(transition.reward);
    // An episode that ends by the clock is worth what would have followed.
    if (transition.end == EpisodeEnd::kTimeUp)
      batch.reward[c] += static_cast<float>(options_.discount) * batch.value[c];
    if (transition.end == EpisodeEnd::kNone) continue;
    ++worker.sums.episodes;
    worker.sums.falls += transition.end == EpisodeEnd::kFell ? 1 : 0;
    worker.sums.episode_seconds += kTick * environment.tick();
    worker.sums.episode_return += worker.returns[i];
    worker.returns[i] = 0.0;
    environment.reset();
  }
}

void Ppo::advantages(int thread, Batch& batch) {
  Worker& worker = *workers_[thread];
  const int each = static_cast<int>(worker.environments.size());
  look(worker);
  worker.critic_input = worker.critic_raw[0];
  state_.agent.critic_input.apply(worker.critic_input);
  const VectorXf last = worker.critic.forward(worker.critic_input).row(0).transpose();
  std::vector<StepWorth> steps(options_.horizon);
  for (int i = 0; i < each; ++i) {
    const auto at = [&](int h) { return (h * options_.threads + thread) * each + i; };
    for (int h = 0; h < options_.horizon; ++h)
      steps[h] = {
          .reward = batch.reward[at(h)], .value = batch.value[at(h)], .ends = batch.end[at(h)] != EpisodeEnd::kNone};
    const std::vector<float> worth = generalised_advantages(steps, last[i], options_.discount, options_.lambda);
    for (int h = 0; h < options_.horizon; ++h) {
      batch.advantage[at(h)] = worth[h];
      batch.target[at(h)] = worth[h] + batch.value[at(h)];
    }
  }
}

double Ppo::minibatch(const std::vector<int>& order, const std::vector<std::uint8_t>& mirrored, int begin, int size,
                      Batch& batch) {
  const int share = size / options_.threads;
  std::vector<double> divergence(options_.threads);
  on_threads(options_.threads, [&](int t) {
    const std::span<const int> samples(order.data() + begin + t * share, static_cast<size_t>(share));
    divergence[t] = gradients(t, samples, mirrored, size, batch);
  });
  apply_gradients();
  return std::accumulate(divergence.begin(), divergence.end(), 0.0) / options_.threads;
}

// Differentiates the clipped objective, entropy and pull to symmetry by the mean, the squared error by the value.
double Ppo::gradients(int thread, std::span<const int> samples, const std::vector<std::uint8_t>& mirrored, int size,
                      Batch& batch) {
  Worker& worker = *workers_[thread];
  const int n = static_cast<int>(samples.size());
  const float share = 1.0F / static_cast<float>(size);
  worker.actor_batch.resize(batch.actor[0].rows(), n);
  worker.critic_batch.resize(batch.critic[0].rows(), n);
  for (int i = 0; i < n; ++i) {
    worker.actor_batch.col(i) = batch.actor[mirrored[samples[i]]].col(samples[i]);
    worker.critic_batch.col(i) = batch.critic[mirrored[samples[i]]].col(samples[i]);
  }
  const double divergence = differentiate_policy(worker, samples, mirrored, share, batch);
  if (critic_alone()) {
    worker.mean_gradient.setZero();
    worker.log_std_gradient.setZero();
  }
  worker.actor.backward(worker.mean_gradient);
  const MatrixXf& value = worker.critic.forward(worker.critic_batch);
  worker.value_gradient.resize(1, n);
  for (int i = 0; i < n; ++i) worker.value_gradient(0, i) = 2.0F * share * (value(0, i) - batch.target[samples[i]]);
  worker.critic.backward(worker.value_gradient);
  return divergence / n;
}

double Ppo::differentiate_policy(Worker& worker, std::span<const int> samples,
                                 const std::vector<std::uint8_t>& mirrored, float share, Batch& batch) const {
  const int n = static_cast<int>(samples.size()), actions = action_mirror_.size();
  const VectorXf inverse_std = (-state_.agent.log_std.array()).exp();
  const float sum_log_std = state_.agent.log_std.sum(), pull = static_cast<float>(options_.mirror_pull) * share;
  const MatrixXf& mean = worker.actor.forward(worker.actor_batch);
  worker.mean_gradient.resize(actions, n);
  worker.log_std_gradient.setConstant(actions, -static_cast<float>(options_.entropy) * share * static_cast<float>(n));
  double divergence = 0.0;
  for (int i = 0; i < n; ++i) {
    const int c = samples[i], m = mirrored[c];
    const auto action = batch.action[m].col(c), old_mean = batch.mean[m].col(c), other_mean = batch.mean[1 - m].col(c);
    const float log_ratio =
        log_probability(inverse_std, sum_log_std, action.data(), mean.col(i).data()) - batch.log_probability[m][c];
    const float weight = share * ratio_gradient(log_ratio, batch.advantage[c], static_cast<float>(options_.clip));
    for (int k = 0; k < actions; ++k) {
      const LikelihoodGradient by = likelihood_gradient(action[k], mean(k, i), inverse_std[k]);
      const float moved = (mean(k, i) - old_mean[k]) * inverse_std[k];
      const float apart = mean(k, i) - action_mirror_.sign[k] * other_mean[action_mirror_.from[k]];
      divergence += 0.5 * static_cast<double>(moved) * moved;
      worker.mean_gradient(k, i) = weight * by.z * inverse_std[k] + pull * apart * inverse_std[k] * inverse_std[k];
      if (m == 0) worker.log_std_gradient[k] += weight * by.log_std;
    }
  }
  return divergence;
}

void Ppo::apply_gradients() {
  Worker& first = *workers_[0];
  auto gradients = flat_views(first.actor.gradient());
  auto critic = flat_views(first.critic.gradient());
  gradients.insert(gradients.end(), critic.begin(), critic.end());
  gradients.emplace_back(first.log_std_gradient.data(), first.log_std_gradient.size());
  for (size_t t = 1; t < workers_.size(); ++t) {
    auto others = flat_views(workers_[t]->actor.gradient());
    auto others_critic = flat_views(workers_[t]->critic.gradient());
    others.insert(others.end(), others_critic.begin(), others_critic.end());
    for (size_t i = 0; i < others.size(); ++i) gradients[i] += others[i];
    gradients.back() += workers_[t]->log_std_gradient;
  }
  auto parameters = flat_views(state_.agent.actor.layers);
  auto critic_parameters = flat_views(state_.agent.critic.layers);
  parameters.insert(parameters.end(), critic_parameters.begin(), critic_parameters.end());
  parameters.emplace_back(state_.agent.log_std.data(), state_.agent.log_std.size());
  state_.adam.step(parameters, gradients, state_.rate, 1.0);
  state_.agent.log_std = state_.agent.log_std.array()
                             .max(static_cast<float>(std::log(options_.least_std)))
                             .min(static_cast<float>(std::log(options_.largest_std)));
}

void Ppo::steer(double divergence) {
  if (divergence > options_.divergence_high) state_.rate = std::max(options_.rate_low, state_.rate / 1.3);
  if (divergence < options_.divergence_low) state_.rate = std::min(options_.rate_high, state_.rate * 1.3);
}

namespace {

constexpr float kFarthestAction = 4.0F;  // standard deviations
constexpr float kLargestLog = 10.0F;     // of a ratio: e^10 is beyond every clip, and finite

}  // namespace

float log_probability(const Eigen::VectorXf& inverse_std, float sum_log_std, const float* action, const float* mean) {
  float sum = -sum_log_std;
  for (Eigen::Index k = 0; k < inverse_std.size(); ++k) {
    const float z = (action[k] - mean[k]) * inverse_std[k];
    sum -= 0.5F * z * z;
  }
  return sum;
}

LikelihoodGradient likelihood_gradient(float action, float mean, float inverse_std) {
  const float z = std::clamp((action - mean) * inverse_std, -kFarthestAction, kFarthestAction);
  return {.z = z, .log_std = z * z - 1.0F};
}

float ratio_gradient(float log_ratio, float advantage, float clip) {
  const float ratio = std::exp(std::clamp(log_ratio, -kLargestLog, kLargestLog));
  const bool clipped = (advantage > 0.0F && ratio > 1.0F + clip) || (advantage < 0.0F && ratio < 1.0F - clip);
  return clipped ? 0.0F : -advantage * ratio;
}

std::vector<float> generalised_advantages(std::span<const StepWorth> steps, float last_value, double discount,
                                          double lambda) {
  const auto gamma = static_cast<float>(discount), decay = static_cast<float>(discount * lambda);
  std::vector<float> advantages(steps.size());
  float advantage = 0.0F, next = last_value;
  for (std::size_t i = steps.size(); i-- > 0;) {
    const StepWorth& step = steps[i];
    const float goes_on = step.ends ? 0.0F : 1.0F;
    advantage = step.reward + gamma * next * goes_on - step.value + decay * goes_on * advantage;
    advantages[i] = advantage;
    next = step.value;
  }
  return advantages;
}

}  // namespace duet
