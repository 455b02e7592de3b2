#include "training/dstar/trainer.h"

#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <numbers>
#include <thread>

#include "core/file.h"
#include "core/require.h"
#include "nn/dense_kernels.h"
#include "training/checkpoint.h"
#include "training/dstar/torch/losses.h"
#include "training/dstar/torch/model.h"
#include "training/threads.h"

namespace duet {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;
using torch::Tensor;

constexpr const char* kFormat = "duet.dstar_training/1";
constexpr const char* kColumns = "step,minutes,loss,action,phase,auxiliary,validation,phase_accuracy,rate\n";
constexpr double kReportEvery = 10.0, kCheckpointEvery = 60.0;  // [s]
constexpr int kValidationWindows = 512, kWarmUp = 200;
constexpr double kLastRate = 0.05;         // of the first
constexpr double kTransitionShare = 0.25;  // of a batch that is also seen half a second later
constexpr float kInputClip = 10.0F;
constexpr int kTransitionTicks = 25;

// Lanes are the threads; a BLAS with threads of its own would fight them.
void one_thread_each() {
  torch::set_num_threads(1);
  using SetThreads = void (*)(int);
  if (auto* set = reinterpret_cast<SetThreads>(dlsym(RTLD_DEFAULT, "openblas_set_num_threads"))) set(1);
}

double since(Clock::time_point begin) { return std::chrono::duration<double>(Clock::now() - begin).count(); }

// All weights in one run of numbers, with views by name: what Adam, EMA and checkpoints work on.
class WeightBlock {
 public:
  explicit WeightBlock(const DstarConfig& config) : shapes_(dstar_tensors(config)) {
    std::size_t size = 0;
    for (const TensorShape& shape : shapes_) size += count(shape);
    values_.assign(size, 0.0F);
  }

  [[nodiscard]] int size() const { return static_cast<int>(values_.size()); }
  [[nodiscard]] float* data() { return values_.data(); }
  [[nodiscard]] const float* data() const { return values_.data(); }
  [[nodiscard]] const std::vector<TensorShape>& shapes() const { return shapes_; }

  [[nodiscard]] Weights views(bool learn) {
    Weights weights;
    float* at = values_.data();
    for (const TensorShape& shape : shapes_) {
      Tensor view = torch::from_blob(at, shape.shape, torch::kFloat32);
      weights[shape.name] = learn ? view.requires_grad_(true) : view;
      at += count(shape);
    }
    return weights;
  }

  [[nodiscard]] std::map<std::string, duet::Tensor> tensors() const {
    std::map<std::string, duet::Tensor> result;
    const float* at = values_.data();
    for (const TensorShape& shape : shapes_) {
      result[shape.name] = {shape.shape, {at, at + count(shape)}};
      at += count(shape);
    }
    return result;
  }

  static std::size_t count(const TensorShape& shape) {
    std::size_t n = 1;
    for (const std::int64_t d : shape.shape) n *= static_cast<std::size_t>(d);
    return n;
  }

 private:
  std::vector<TensorShape> shapes_;
  std::vector<float> values_;
};

bool ends_with(const std::string& text, const char* end) { return text.ends_with(end); }

// Weights uniform in +-1 / sqrt(inputs), biases 0, norms 1, the last layer of each residual branch and the output
// small.
void initialise(WeightBlock& block, std::uint64_t seed) {
  Random random(seed, stream_key({"dstar weights"}));
  float* at = block.data();
  for (const TensorShape& shape : block.shapes()) {
    const std::size_t n = WeightBlock::count(shape);
    const bool norm = shape.name.find("norm") != std::string::npos;
    if (ends_with(shape.name, ".bias")) {
      std::fill(at, at + n, 0.0F);
    } else if (norm) {
      std::fill(at, at + n, 1.0F);
    } else {
      const double inputs = static_cast<double>(n) / static_cast<double>(shape.shape[0]);
      const bool position = ends_with(shape.name, "position");
      const bool last = ends_with(shape.name, "conv2.weight") || ends_with(shape.name, "film_condition.weight") ||
                        ends_with(shape.name, "film_step.weight");
      const double bound = position ? 0.05 : (last ? 0.3 : 1.0) * std::sqrt(3.0 / (3.0 * inputs)) * std::sqrt(1.5);
      for (std::size_t i = 0; i < n; ++i) at[i] = static_cast<float>(random.uniform(-bound, bound));
    }
    at += n;
  }
}

Tensor view(Eigen::MatrixXf& matrix, at::IntArrayRef shape) { return torch::from_blob(matrix.data(), shape); }

Tensor vector_tensor(const Eigen::VectorXf& v) {
  return torch::from_blob(const_cast<float*>(v.data()), {v.size()}).clone();
}

// What a network sees of a batch, and what it should answer.
struct Batch {
  WindowBatch windows, later;  // later: the first ones half a second on
  Tensor language;
};

// Normalisers and language as tensors.
struct Units {
  Units(const WindowStatistics& s, const LanguageEncoder& encoder)
      : frame_mean(vector_tensor(s.frame_mean)),
        frame_deviation(vector_tensor(s.frame_deviation)),
        plan_mean(vector_tensor(s.plan_mean).view({kAnchors, kAnchorSize})),
        plan_deviation(vector_tensor(s.plan_deviation).view({kAnchors, kAnchorSize})) {
    for (const Task task : kTasks) {
      std::vector<std::vector<float>> rows = {encoder.embed(task_prompt(task))};
      for (const std::string& text : task_paraphrases(task)) rows.push_back(encoder.embed(text));
      prompts.push_back(std::move(rows));
    }
  }

  [[nodiscard]] Tensor frames(WindowBatch& batch) const {
    const Tensor raw = view(batch.frames, {batch.size, kHistoryFrames, kFrameSize});
    return ((raw - frame_mean) / frame_deviation).clamp(-kInputClip, kInputClip);
  }

  [[nodiscard]] Tensor language(const WindowBatch& batch) const {
    const auto size = static_cast<std::int64_t>(prompts[0][0].size());
    Tensor rows = torch::empty({batch.size, size});
    for (int i = 0; i < batch.size; ++i) {
      const std::vector<float>& row = prompts[batch.task[i]][batch.prompt[i] + 1];
      std::copy(row.begin(), row.end(), rows.data_ptr<float>() + size * i);
    }
    return rows;
  }

  [[nodiscard]] ModelInput input(WindowBatch& batch) const {
    return {frames(batch), view(batch.position, {batch.size, kPositionSize}),
            view(batch.distance, {batch.size, kRelations}), view(batch.orientation, {batch.size, kOrientationSize}),
            language(batch)};
  }

  Tensor frame_mean, frame_deviation, plan_mean, plan_deviation;
  std::vector<std::vector<std::vector<float>>> prompts;  // per task: the prompt, then its paraphrases
};

struct LossParts {
  double total = 0.0, action = 0.0, phase = 0.0, auxiliary = 0.0;
};

Tensor tensor_of_ints(const std::vector<int>& values) {
  return torch::tensor(std::vector<std::int64_t>(values.begin(), values.end()), torch::kInt64);
}

// x_t, t for each window, and the noise that made it.
Tensor noised(const Tensor& clean, const Tensor& step, const std::vector<double>& alpha_bar, Random& random) {
  Tensor noise = torch::empty_like(clean);
  auto* out = noise.data_ptr<float>();
  for (std::int64_t i = 0; i < noise.numel(); ++i) out[i] = static_cast<float>(random.normal());
  std::vector<float> bars;
  for (std::int64_t i = 0; i < step.size(0); ++i)
    bars.push_back(static_cast<float>(alpha_bar[step.data_ptr<std::int64_t>()[i]]));
  const Tensor bar = torch::tensor(bars).view({-1, 1, 1});
  return bar.sqrt() * clean + (1.0 - bar).sqrt() * noise;
}

class Trainer {
 public:
  Trainer(const DstarData& data, const DstarRun& run)
      : data_(data),
        run_(run),
        weights_(run.config),
        average_(run.config),
        m_(weights_.size(), 0.0F),
        v_(weights_.size(), 0.0F),
        gradient_(weights_.size(), 0.0F),
        alpha_bar_(squared_cosine_alpha_bar(run.config.training_steps)),
        windows_(list_windows(*data.train, run.windows)),
        validation_windows_(list_windows(*data.validation, run.windows)) {
    require(!windows_.empty() && !validation_windows_.empty(), "training D-STAR: a set of demonstrations is empty");
    require(run.batch >= 8 && run.threads >= 1 && run.batch % run.threads == 0,
            fmt::format("training D-STAR: batches of {} windows on {} threads; expected a multiple, 8 or more",
                        run.batch, run.threads));
    one_thread_each();
    WindowMaker maker(data.robot, *data.train, run.windows);
    statistics_ = window_statistics(maker, windows_, run.seed);
    units_ = std::make_unique<Units>(statistics_, *data.language);
    for (int i = 0; i < run.threads; ++i) lanes_.push_back(std::make_unique<Lane>(data, run));
    initialise(weights_, run.seed);
    std::copy(weights_.data(), weights_.data() + weights_.size(), average_.data());
    fill_validation();
  }

  // One step of Adam; the same step number gives the same numbers.
  LossParts step() {
    on_threads(run_.threads, [&](int lane) { work(*lanes_[lane], lane); });
    LossParts parts;
    for (int lane = 0; lane < run_.threads; ++lane) {
      const float* g = lanes_[lane]->gradient.data();
      for (int i = 0; i < weights_.size(); ++i) gradient_[i] = lane == 0 ? g[i] : gradient_[i] + g[i];
      parts.total += lanes_[lane]->parts.total / run_.threads;
      parts.action += lanes_[lane]->parts.action / run_.threads;
      parts.phase += lanes_[lane]->parts.phase / run_.threads;
      parts.auxiliary += lanes_[lane]->parts.auxiliary / run_.threads;
    }
    apply();
    ++step_;
    return parts;
  }

  // Action loss of sampled plans and the share of phases told right, with the averaged weights.
  std::pair<double, double> validate() {
    const torch::NoGradGuard guard;
    const Weights weights = average_.views(false);
    const ModelCondition encoded = encode(run_.config, weights, units_->input(validation_));
    const Tensor plan = sample(run_.config, weights, validation_noise_, encoded.condition);
    const Tensor wanted = view(validation_.plan, {validation_.size, kAnchors, kAnchorSize});
    const double loss =
        action_loss(run_.loss, plan * units_->plan_deviation + units_->plan_mean, wanted).item<double>();
    if (!encoded.phase_logits.defined()) return {loss, 0.0};
    const Tensor right = encoded.phase_logits.argmax(1) == tensor_of_ints(validation_.phase);
    return {loss, right.to(torch::kFloat32).mean().item<double>()};
  }

  [[nodiscard]] DstarNetwork network() const {
    DstarNetwork network;
    network.config = run_.config;
    network.robot = data_.robot->name;
    network.joints = data_.robot->joint_names();
    network.channels = channel_names(*data_.robot);
    network.weights = average_.tensors();
    network.frame_mean = statistics_.frame_mean;
    network.frame_deviation = statistics_.frame_deviation;
    network.plan_mean = statistics_.plan_mean;
    network.plan_deviation = statistics_.plan_deviation;
    network.language = data_.language->name();
    network.notes = {{"policy", run_.name},
                     {"seed", std::to_string(run_.seed)},
                     {"steps", std::to_string(step_)},
                     {"batch", std::to_string(run_.batch)},
                     {"windows", std::to_string(windows_.size())},
                     {"demonstrations", std::to_string(data_.train->list.size())}};
    return network;
  }

  void save(double minutes);
  double restore();  // minutes so far; 0 where there is no checkpoint

  [[nodiscard]] long steps() const { return step_; }
  [[nodiscard]] double rate() const {
    const double warm = std::min(1.0, static_cast<double>(step_ + 1) / kWarmUp);
    const double done = std::min(1.0, static_cast<double>(step_) / static_cast<double>(std::max(1L, run_.steps)));
    return run_.rate * warm * (kLastRate + (1.0 - kLastRate) * 0.5 * (1.0 + std::cos(std::numbers::pi * done)));
  }
  double best = 1e30;
  int stale = 0;  // validations since the best one

 private:
  struct Lane {
    Lane(const DstarData& data, const DstarRun& run)
        : weights(run.config),
          maker(data.robot, *data.train, run.windows),
          gradient(weights.size(), 0.0F),
          leaves(weights.views(true)) {
      batch.windows.resize(run.batch / run.threads);
      batch.later.resize(std::max(1, static_cast<int>(kTransitionShare * batch.windows.size)));
    }
    WeightBlock weights;
    WindowMaker maker;
    std::vector<float> gradient;
    Weights leaves;
    Batch batch;
    LossParts parts;
  };

  // Made of the first demonstrations and kept, whatever is added later.
  [[nodiscard]] std::map<std::string, Eigen::VectorXf*> normalisers() {
    return {{"frame_mean", &statistics_.frame_mean},
            {"frame_deviation", &statistics_.frame_deviation},
            {"plan_mean", &statistics_.plan_mean},
            {"plan_deviation", &statistics_.plan_deviation}};
  }

  void fill_validation() {
    WindowOptions options = run_.windows;
    options.augment = false;
    WindowMaker maker(data_.robot, *data_.validation, options);
    Random random(run_.seed, stream_key({"dstar validation"}));
    validation_.resize(kValidationWindows);
    for (int i = 0; i < kValidationWindows; ++i)
      maker.make(validation_windows_[random.below(static_cast<int>(validation_windows_.size()))], random, validation_,
                 i);
    validation_noise_ = torch::empty({kValidationWindows, kAnchors, kAnchorSize});
    auto* out = validation_noise_.data_ptr<float>();
    for (std::int64_t i = 0; i < validation_noise_.numel(); ++i) out[i] = static_cast<float>(random.normal());
  }

  void fill(Lane& lane, Random& random) {
    WindowBatch& now = lane.batch.windows;
    WindowBatch& later = lane.batch.later;
    for (int i = 0; i < now.size; ++i) {
      Window window = windows_[random.below(static_cast<int>(windows_.size()))];
      lane.maker.make(window, random, now, i);
      if (i >= later.size) continue;
      const int last = data_.train->list[window.demonstration].frames - 1;
      window.frame = std::min(last, window.frame + kTransitionTicks);
      lane.maker.make(window, random, later, i);
    }
  }

  void work(Lane& lane, int number) {
    Random random(run_.seed, stream_key({"dstar step", std::to_string(step_), std::to_string(number)}));
    fill(lane, random);
    std::copy(weights_.data(), weights_.data() + weights_.size(), lane.weights.data());
    WindowBatch& batch = lane.batch.windows;
    const ModelInput input = units_->input(batch);
    const ModelCondition encoded = encode(run_.config, lane.leaves, input);
    const Tensor wanted = view(batch.plan, {batch.size, kAnchors, kAnchorSize});
    const Tensor clean = (wanted - units_->plan_mean) / units_->plan_deviation;
    Tensor step = torch::empty({batch.size}, torch::kInt64);
    for (int i = 0; i < batch.size; ++i) step.data_ptr<std::int64_t>()[i] = random.below(run_.config.training_steps);
    const Tensor x = noised(clean, step, alpha_bar_, random);
    const Tensor plan =
        denoise(run_.config, lane.leaves, x, step, encoded.condition) * units_->plan_deviation + units_->plan_mean;
    const Tensor loss = total_loss(lane, plan, wanted, encoded);
    (loss / run_.threads).backward();
    collect(lane);
  }

  Tensor total_loss(Lane& lane, const Tensor& plan, const Tensor& wanted, const ModelCondition& encoded) {
    WindowBatch& batch = lane.batch.windows;
    const DstarLoss& w = run_.loss;
    Tensor loss = action_loss(w, plan, wanted);
    lane.parts.action = loss.item<double>();
    if (w.lambda_auxiliary > 0.0) {
      const Tensor partner = view(batch.partner, {batch.size, kAnchors, kLossPoints, 3});
      const Tensor root =
          view(batch.frames, {batch.size, kHistoryFrames, kFrameSize}).select(1, kHistoryFrames - 1).slice(1, 0, 3);
      const Tensor auxiliary = auxiliary_loss(w, data_.robot, plan, wanted, partner, root);
      lane.parts.auxiliary = auxiliary.item<double>();
      loss = loss + w.lambda_auxiliary * auxiliary;
    }
    if (w.lambda_phase > 0.0 && encoded.phase_logits.defined()) {
      const Tensor next = classify(run_.config, lane.leaves, units_->frames(lane.batch.later));
      const Tensor phase = phase_loss(w, encoded.phase_logits, tensor_of_ints(batch.phase), next);
      lane.parts.phase = phase.item<double>();
      loss = loss + w.lambda_phase * phase;
    }
    lane.parts.total = loss.item<double>();
    return loss;
  }

  static void collect(Lane& lane) {
    float* at = lane.gradient.data();
    for (const TensorShape& shape : lane.weights.shapes()) {
      Tensor& gradient = lane.leaves.at(shape.name).mutable_grad();
      const std::size_t n = WeightBlock::count(shape);
      if (gradient.defined()) {
        const Tensor flat = gradient.contiguous();
        std::copy(flat.data_ptr<float>(), flat.data_ptr<float>() + n, at);
        gradient.reset();
      } else {
        std::fill(at, at + n, 0.0F);
      }
      at += n;
    }
  }

  // Adam with the gradient's norm bounded, then the running average.
  void apply() {
    const Eigen::Map<const Eigen::VectorXf> g(gradient_.data(), weights_.size());
    const float norm = g.norm();
    const float scale = norm > 5.0F ? 5.0F / norm : 1.0F;
    const double t = static_cast<double>(step_ + 1);
    dense_kernels().adam(weights_.size(), gradient_.data(), scale,
                         static_cast<float>(rate() / (1.0 - std::pow(0.9, t))),
                         static_cast<float>(1.0 - std::pow(0.999, t)), m_.data(), v_.data(), weights_.data());
    const auto keep = static_cast<float>(std::min(run_.average, (1.0 + t) / (10.0 + t)));
    Eigen::Map<Eigen::VectorXf> average(average_.data(), average_.size());
    average = keep * average + (1.0F - keep) * Eigen::Map<const Eigen::VectorXf>(weights_.data(), weights_.size());
  }

  DstarData data_;
  DstarRun run_;
  WeightBlock weights_, average_;
  std::vector<float> m_, v_, gradient_;
  std::vector<double> alpha_bar_;
  std::vector<Window> windows_, validation_windows_;
  WindowStatistics statistics_;
  std::unique_ptr<Units> units_;
  std::vector<std::unique_ptr<Lane>> lanes_;
  WindowBatch validation_;
  Tensor validation_noise_;
  long step_ = 0;
};

duet::Tensor flat(const float* values, int size) { return {{size}, {values, values + size}}; }

void Trainer::save(double minutes) {
  SafeTensors file;
  file.metadata = {{"format", kFormat},
                   {"robot_digest", data_.robot->digest},
                   {"config", to_json_text(run_.config)},
                   {"seed", std::to_string(run_.seed)},
                   {"step", std::to_string(step_)},
                   {"minutes", fmt::format("{}", minutes)},
                   {"best", fmt::format("{}", best)},
                   {"stale", std::to_string(stale)}};
  for (const auto& [name, values] : normalisers())
    file.tensors[name] = flat(values->data(), static_cast<int>(values->size()));
  file.tensors["weights"] = flat(weights_.data(), weights_.size());
  file.tensors["average"] = flat(average_.data(), average_.size());
  file.tensors["adam.m"] = flat(m_.data(), weights_.size());
  file.tensors["adam.v"] = flat(v_.data(), weights_.size());
  write_safetensors(dstar_checkpoint(run_), file);
}

void expect(const std::string& path, const char* what, const std::string& expected, const std::string& found) {
  if (expected == found) return;
  throw InputError(fmt::format("{}: a checkpoint of another {}: expected {}, found {}: choose another folder", path,
                               what, expected.substr(0, 200), found.substr(0, 200)));
}

double Trainer::restore() {
  const std::string path = dstar_checkpoint(run_);
  if (!fs::exists(path)) return 0.0;
  const SafeTensors file = read_safetensors(path);
  check_format(file, kFormat, path);
  expect(path, "robot", data_.robot->digest, text_of(file, "robot_digest", path));
  expect(path, "configuration", to_json_text(run_.config), text_of(file, "config", path));
  expect(path, "seed", std::to_string(run_.seed), text_of(file, "seed", path));
  const auto load = [&](const char* name, float* out) {
    const Eigen::VectorXf values = vector_of(file, name, weights_.size(), path);
    std::copy(values.begin(), values.end(), out);
  };
  for (const auto& [name, values] : normalisers()) *values = vector_of(file, name, values->size(), path);
  units_ = std::make_unique<Units>(statistics_, *data_.language);
  load("weights", weights_.data());
  load("average", average_.data());
  load("adam.m", m_.data());
  load("adam.v", v_.data());
  step_ = static_cast<long>(number_of(file, "step", path));
  best = number_of(file, "best", path);
  stale = static_cast<int>(number_of(file, "stale", path));
  return number_of(file, "minutes", path);
}

// Sums between reports; writes the curve.
class Log {
 public:
  Log(const DstarRun& run, long done, double minutes) : run_(run), first_(done), minutes_(minutes) {
    fs::create_directories(fs::path(dstar_curves(run)).parent_path());
    if (done == 0) write_file(dstar_curves(run), kColumns);
  }
  void add(const LossParts& parts) {
    sum_.loss += parts.total;
    sum_.action += parts.action;
    sum_.phase += parts.phase;
    sum_.auxiliary += parts.auxiliary;
    ++count_;
  }
  [[nodiscard]] bool report_due() const { return since(reported_) > kReportEvery; }
  [[nodiscard]] bool save_due() const { return since(saved_) > kCheckpointEvery; }
  void saved() { saved_ = Clock::now(); }
  [[nodiscard]] double minutes() const { return minutes_ + since(begin_) / 60.0; }
  void validated(double loss, double accuracy, long step, double rate) {
    progress_.validation = loss;
    progress_.phase_accuracy = accuracy;
    const double n = std::max(1, count_);
    std::ofstream(dstar_curves(run_), std::ios::app)
        << fmt::format("{},{:.3f},{:.5f},{:.5f},{:.5f},{:.5f},{:.5f},{:.4f},{:.2e}\n", step, minutes(), sum_.loss / n,
                       sum_.action / n, sum_.phase / n, sum_.auxiliary / n, loss, accuracy, rate);
  }
  DstarProgress report(long step) {
    DstarProgress progress = progress_;
    const double n = std::max(1, count_);
    progress.step = step;
    progress.steps = run_.steps;
    progress.loss = sum_.loss / n;
    progress.action = sum_.action / n;
    progress.phase = sum_.phase / n;
    progress.auxiliary = sum_.auxiliary / n;
    const double speed = static_cast<double>(step - first_) / std::max(1e-9, since(begin_));
    progress.windows_per_second = speed * run_.batch;
    progress.seconds_left = static_cast<double>(run_.steps - step) / std::max(1e-9, speed);
    sum_ = {};
    count_ = 0;
    reported_ = Clock::now();
    return progress;
  }

 private:
  DstarRun run_;
  long first_;
  double minutes_;
  Clock::time_point begin_ = Clock::now(), reported_ = begin_, saved_ = begin_;
  DstarProgress progress_, sum_;
  int count_ = 0;
};

}  // namespace

DstarEnd train_dstar(const DstarData& data, const DstarRun& run,
                     const std::function<void(const DstarProgress&)>& report, const std::function<bool()>& stop) {
  Trainer trainer(data, run);
  const double minutes = trainer.restore();
  Log log(run, trainer.steps(), minutes);
  const auto save = [&] {
    trainer.save(log.minutes());
    log.saved();
  };
  const long until = run.until > 0 ? std::min(run.until, run.steps) : run.steps;
  const auto keep = [&] { save_dstar_network(dstar_network_file(run), trainer.network(), TensorType::kF32); };
  while (trainer.steps() < until) {
    if (stop()) return save(), DstarEnd::kStopped;
    log.add(trainer.step());
    if (trainer.steps() % run.validate_every == 0 || trainer.steps() == run.steps) {
      const auto [loss, accuracy] = trainer.validate();
      trainer.stale = loss < trainer.best ? 0 : trainer.stale + 1;
      if (loss < trainer.best) keep();
      trainer.best = std::min(trainer.best, loss);
      log.validated(loss, accuracy, trainer.steps(), trainer.rate());
      report(log.report(trainer.steps()));
      if (run.patience > 0 && trainer.stale >= run.patience) return save(), DstarEnd::kEarly;
    } else if (log.report_due()) {
      report(log.report(trainer.steps()));
    }
    if (log.save_due()) save();
  }
  // The rate has fallen to its end: the average of now is kept, though another may have been better on the states of
  // the demonstrations, which are not those that the policy will be in.
  keep();
  save();
  return until < run.steps ? DstarEnd::kPaused : DstarEnd::kComplete;
}

double runner_difference(const DstarData& data, const DstarRun& run, const std::string& file, int windows) {
  const torch::NoGradGuard guard;
  one_thread_each();
  const std::shared_ptr<const DstarNetwork> network = load_dstar_network(file, *data.robot);
  Weights weights;
  for (const auto& [name, tensor] : network->weights)
    weights[name] = torch::from_blob(const_cast<float*>(tensor.values.data()), tensor.shape).clone();
  const Units units({network->frame_mean, network->frame_deviation, network->plan_mean, network->plan_deviation},
                    *data.language);
  WindowOptions options = run.windows;
  options.augment = false;
  WindowMaker maker(data.robot, *data.validation, options);
  const std::vector<Window> all = list_windows(*data.validation, options);
  Random random(run.seed, stream_key({"dstar golden"}));
  WindowBatch batch;
  batch.resize(windows);
  for (int i = 0; i < windows; ++i) maker.make(all[random.below(static_cast<int>(all.size()))], random, batch, i);
  torch::Tensor noise = torch::empty({windows, kAnchors, kAnchorSize});
  for (int i = 0; i < noise.numel(); ++i) noise.data_ptr<float>()[i] = static_cast<float>(random.normal());
  const ModelInput input = units.input(batch);
  const torch::Tensor plan =
      sample(network->config, weights, noise, encode(network->config, weights, input).condition).contiguous();
  DstarRunner runner(network);
  double worst = 0.0;
  for (int i = 0; i < windows; ++i) {
    DstarFeatures features;
    features.frames = batch.frames.col(i).reshaped(kFrameSize, kHistoryFrames);
    features.position = batch.position.col(i);
    features.distance = batch.distance.col(i);
    features.orientation = batch.orientation.col(i);
    const auto row = [&](const torch::Tensor& t) { return t.data_ptr<float>() + t.numel() / windows * i; };
    const auto language = static_cast<std::size_t>(input.language.size(1));
    runner.run({&features, {row(input.language), language}, {row(noise), kPlanSize}});
    for (int k = 0; k < kPlanSize; ++k)
      worst = std::max(worst, std::abs(static_cast<double>(runner.normalised_plan()[k]) - row(plan)[k]));
  }
  return worst;
}

bool can_train_dstar() { return true; }

std::string training_blas() {
  Dl_info info{};
  void* gemm = dlsym(RTLD_DEFAULT, "sgemm_");
  if (gemm == nullptr || dladdr(gemm, &info) == 0 || info.dli_fname == nullptr) return "unknown";
  return fs::weakly_canonical(info.dli_fname).filename().string() +
         (dlsym(RTLD_DEFAULT, "openblas_set_num_threads") != nullptr ? " (OpenBLAS)" : " (the slow reference BLAS)");
}

}  // namespace duet
