#include "duet/training/dstar/trainer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <future>
#include <numbers>

#include "duet/core/require.h"
#include "duet/nn/dense_kernels.h"
#include "duet/training/agent.h"
#include "duet/training/dstar/torch/blas.h"
#include "duet/training/dstar/torch/device_network.h"
#include "duet/training/dstar/torch/losses.h"
#include "duet/training/dstar/torch/model.h"
#include "duet/training/dstar/trainer.h"
#include "duet/training/threads.h"

namespace duet {
namespace {

namespace fs = std::filesystem;
using torch::Tensor;

constexpr const char* kFormat = "duet.dstar_training/1";
constexpr int kValidationWindows = 512, kWarmUp = 200;
constexpr double kLastRate = 0.05;         // of the first
constexpr double kTransitionShare = 0.25;  // of a batch that is also seen half a second later
constexpr int kTransitionTicks = 25;

Tensor tensor_of_ints(const std::vector<int>& values) {
  return torch::tensor(std::vector<std::int64_t>(values.begin(), values.end()), torch::kInt64);
}

// x_t, t for each window, and the noise that made it.
Tensor noised(const Tensor& clean, const Tensor& step, const std::vector<double>& alpha_bar, Random& random) {
  const Tensor noise = normal_noise(clean.sizes(), random);
  std::vector<float> bars;
  for (std::int64_t i = 0; i < step.size(0); ++i)
    bars.push_back(static_cast<float>(alpha_bar[step.data_ptr<std::int64_t>()[i]]));
  const Tensor bar = torch::tensor(bars).view({-1, 1, 1});
  return bar.sqrt() * clean + (1.0 - bar).sqrt() * noise;
}

torch::Device device_of(const std::string& name) {
  require(name == "auto" || name == "cpu" || name == "cuda",
          "training D-STAR: device: expected auto, cpu or cuda, found '{}'", name);
  if (name != "cpu" && torch::cuda::is_available()) return torch::kCUDA;
  if (name == "cuda") throw MissingError("training D-STAR: the libtorch that duet was built with finds no GPU (CUDA)");
  return torch::kCPU;
}

ModelInput on_device(const ModelInput& input, torch::Device device) {
  return {input.frames.to(device),   input.past.to(device),        input.position.to(device),
          input.distance.to(device), input.orientation.to(device), input.language.to(device)};
}

ModelInput joined(const std::vector<ModelInput>& parts) {
  const auto all = [&](Tensor ModelInput::*member) {
    std::vector<Tensor> tensors;
    for (const ModelInput& part : parts) tensors.push_back(part.*member);
    return torch::cat(tensors);
  };
  return {all(&ModelInput::frames),   all(&ModelInput::past),        all(&ModelInput::position),
          all(&ModelInput::distance), all(&ModelInput::orientation), all(&ModelInput::language)};
}

class Trainer {
 public:
  Trainer(const DstarData& data, const DstarRun& run)
      : data_(data),
        run_(run),
        device_(device_of(run.device)),
        state_(run.config),
        gradient_(state_.weights.size(), 0.0F),
        alpha_bar_(squared_cosine_alpha_bar(run.config.training_steps)),
        windows_(list_windows(*data.train, windows_of(run))),
        validation_windows_(list_windows(*data.validation, windows_of(run))) {
    require(!windows_.empty() && !validation_windows_.empty(), "training D-STAR: a set of demonstrations is empty");
    require(run.batch >= 8 && run.threads >= 1 && run.batch % run.threads == 0,
            "training D-STAR: batches of {} windows on {} threads; expected a multiple, 8 or more", run.batch,
            run.threads);
    one_thread_each();
    WindowMaker maker(data.robot, *data.train, windows_of(run));
    statistics_ = window_statistics(maker, windows_, run.seed);
    state_.weights.initialise(run.seed);
    if (run.from) begin_with(*run.from);
    units_ = std::make_unique<Units>(statistics_, *data.language, leads());
    for (int i = 0; i < run.threads; ++i) lanes_.push_back(std::make_unique<Lane>(data, run));
    std::copy_n(state_.weights.data(), state_.weights.size(), state_.average.data());
    fill_validation();
    to_device();
  }

  // One step of Adam; the same step number gives the same numbers on a CPU.
  LossParts step() {
    if (network_)
      learn_on_device();
    else
      learn_on_threads();
    LossParts parts;
    for (const auto& lane : lanes_) {
      parts.total += lane->parts.total / run_.threads;
      parts.action += lane->parts.action / run_.threads;
      parts.phase += lane->parts.phase / run_.threads;
      parts.auxiliary += lane->parts.auxiliary / run_.threads;
    }
    ++step_;
    return parts;
  }

  // Action loss of sampled plans and the share of phases told right, with the averaged weights.
  std::pair<double, double> validate() {
    const torch::NoGradGuard guard;
    const Weights weights = network_ ? network_->average() : state_.average.views(false);
    const ModelCondition encoded = encode(run_.config, weights, on_device(units_->input(validation_), device_));
    const Tensor plan = sample(run_.config, weights, validation_noise_.to(device_), encoded.condition).cpu();
    const Tensor wanted = view(validation_.plan, {validation_.size, kAnchors, kAnchorSize});
    const double loss = action_loss(run_.loss, units_->physical(plan), wanted).item<double>();
    if (!encoded.phase_logits.defined()) return {loss, 0.0};
    const Tensor right = encoded.phase_logits.cpu().argmax(1) == tensor_of_ints(validation_.phase);
    return {loss, right.to(torch::kFloat32).mean().item<double>()};
  }

  [[nodiscard]] DstarNetwork network() {
    if (network_) network_->read(state_);
    DstarNetwork network;
    network.config = run_.config;
    network.robot = data_.robot->name;
    network.joints = data_.robot->joint_names();
    network.channels = channel_names(*data_.robot);
    network.weights = state_.average.tensors();
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
                     {"demonstrations", std::to_string(data_.train->list.size())},
                     {"device", device_.str()}};
    if (leads()) network.notes[kBegins] = "half of the gestures";
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
  // One thread's work: its share of each batch.
  struct Lane {
    Lane(const DstarData& data, const DstarRun& run)
        : weights(run.config),
          maker(data.robot, *data.train, windows_of(run)),
          gradient(weights.size(), 0.0F),
          leaves(weights.views(true)) {
      for (Drawn* drawn : {&now, &next}) {
        drawn->windows.resize(run.batch / run.threads);
        drawn->later.resize(std::max(1, static_cast<int>(kTransitionShare * drawn->windows.size)));
      }
    }
    struct Drawn {
      WindowBatch windows, later;  // later: the first ones half a second on
      Tensor step, x;              // of the noise, and the plans under it
    };
    WeightBlock weights;
    WindowMaker maker;
    std::vector<float> gradient;
    Weights leaves;
    Drawn now, next;
    LossParts parts;
  };

  [[nodiscard]] bool leads() const { return std::ranges::any_of(data_.train->list, &Demonstration::leads); }

  void begin_with(const DstarNetwork& network) {
    const std::string expected = to_json_text(run_.config), found = to_json_text(network.config);
    require(expected == found,
            "training D-STAR: the network to begin with has another configuration: "
            "expected {}, found {}",
            expected, found);
    require(network.language == data_.language->name(),
            "training D-STAR: the network to begin with learnt from the language encoder '{}', this is '{}'",
            network.language, data_.language->name());
    state_.weights.assign(network.weights);
    statistics_ = {network.frame_mean, network.frame_deviation, network.plan_mean, network.plan_deviation};
  }

  // Made of the first demonstrations and kept, whatever is added later.
  [[nodiscard]] std::map<std::string, Eigen::VectorXf*> normalisers() {
    return {{"frame_mean", &statistics_.frame_mean},
            {"frame_deviation", &statistics_.frame_deviation},
            {"plan_mean", &statistics_.plan_mean},
            {"plan_deviation", &statistics_.plan_deviation}};
  }

  void fill_validation() {
    WindowOptions options = windows_of(run_);
    options.augment = false;
    WindowMaker maker(data_.robot, *data_.validation, options);
    Random random(run_.seed, stream_key({"dstar validation"}));
    validation_.resize(kValidationWindows);
    draw_windows(maker, validation_windows_, random, validation_);
    validation_noise_ = normal_noise({kValidationWindows, kAnchors, kAnchorSize}, random);
  }

  void to_device() {
    network_.reset();
    drawn_ = -1;
    if (device_.is_cpu()) return;
    at::globalContext().setDeterministicCuDNN(true);
    network_ = std::make_unique<DeviceNetwork>(state_, device_);
  }

  // The windows of that step and the noise on their plans: a thread's share.
  void draw(Lane& lane, Lane::Drawn& drawn, long step, int number) {
    Random random(run_.seed, stream_key({"dstar step", std::to_string(step), std::to_string(number)}));
    WindowBatch& now = drawn.windows;
    for (int i = 0; i < now.size; ++i) {
      Window window = windows_[random.below(static_cast<int>(windows_.size()))];
      lane.maker.make(window, random, now, i);
      if (i >= drawn.later.size) continue;
      const int last = data_.train->list[window.demonstration].frames - 1;
      window.frame = std::min(last, window.frame + kTransitionTicks);
      lane.maker.make(window, random, drawn.later, i);
    }
    drawn.step = torch::empty({now.size}, torch::kInt64);
    for (int i = 0; i < now.size; ++i)
      drawn.step.data_ptr<std::int64_t>()[i] = random.below(run_.config.training_steps);
    drawn.x = noised(units_->normalised(wanted_of(now)), drawn.step, alpha_bar_, random);
  }

  static Tensor wanted_of(WindowBatch& batch) { return view(batch.plan, {batch.size, kAnchors, kAnchorSize}); }

  void learn_on_threads() {
    on_threads(run_.threads, [&](int lane) { learn(*lanes_[lane], lane); });
    for (int lane = 0; lane < run_.threads; ++lane) {
      const float* g = lanes_[lane]->gradient.data();
      for (std::size_t i = 0; i < gradient_.size(); ++i) gradient_[i] = lane == 0 ? g[i] : gradient_[i] + g[i];
    }
    apply();
  }

  void learn(Lane& lane, int number) {
    draw(lane, lane.now, step_, number);
    std::copy_n(state_.weights.data(), state_.weights.size(), lane.weights.data());
    const ModelCondition encoded = encode(run_.config, lane.leaves, units_->input(lane.now.windows));
    const Tensor clean = denoise(run_.config, lane.leaves, lane.now.x, lane.now.step, encoded.condition);
    const Tensor next = later_logits(lane.leaves, encoded, [&] { return units_->input(lane.now.later); });
    (total_loss(lane, clean, encoded.phase_logits, next) / run_.threads).backward();
    collect(lane);
  }

  // One network sees the whole batch; windows and losses are made on the CPU's threads, windows of the next step while
  // the network learns.
  void learn_on_device() {
    const auto draw_all = [this](Lane::Drawn Lane::*drawn, long step) {
      on_threads(run_.threads, [&](int lane) { draw(*lanes_[lane], (*lanes_[lane]).*drawn, step, lane); });
    };
    if (drawn_ != step_) draw_all(&Lane::now, step_);
    std::future<void> drawing = std::async(std::launch::async, draw_all, &Lane::next, step_ + 1);
    const auto input = [&](WindowBatch Lane::Drawn::*batch) {
      std::vector<ModelInput> parts;
      for (const auto& lane : lanes_) parts.push_back(units_->input(lane->now.*batch));
      return on_device(joined(parts), device_);
    };
    const auto all = [&](Tensor Lane::Drawn::*part) {
      std::vector<Tensor> parts;
      for (const auto& lane : lanes_) parts.push_back(lane->now.*part);
      return torch::cat(parts).to(device_);
    };
    const Weights& leaves = network_->leaves();
    const ModelCondition encoded = encode(run_.config, leaves, input(&Lane::Drawn::windows));
    const Tensor clean = denoise(run_.config, leaves, all(&Lane::Drawn::x), all(&Lane::Drawn::step), encoded.condition);
    const Tensor next = later_logits(leaves, encoded, [&] { return input(&Lane::Drawn::later); });
    pull_back({clean, encoded.phase_logits, next});
    network_->apply({step_, rate(), run_.average});
    drawing.get();
    for (const auto& lane : lanes_) std::swap(lane->now, lane->next);
    drawn_ = step_ + 1;
  }

  // The loss on the CPU's threads, then its gradient through the network.
  void pull_back(std::vector<Tensor> outputs) {
    std::erase_if(outputs, [](const Tensor& output) { return !output.defined(); });
    std::vector<Tensor> host, gradients(outputs.size());
    for (const Tensor& output : outputs) host.push_back(output.detach().cpu());
    std::vector<std::vector<Tensor>> shares(lanes_.size());
    on_threads(run_.threads, [&](int number) {
      for (const Tensor& output : host)
        shares[number].push_back(output.chunk(run_.threads)[number].clone().requires_grad_(true));
      const std::vector<Tensor>& share = shares[number];
      const auto at = [&](std::size_t i) { return i < share.size() ? share[i] : Tensor(); };
      (total_loss(*lanes_[number], at(0), at(1), at(2)) / run_.threads).backward();
    });
    for (std::size_t i = 0; i < outputs.size(); ++i) {
      std::vector<Tensor> parts;
      for (const std::vector<Tensor>& share : shares)
        parts.push_back(share[i].grad().defined() ? share[i].grad() : torch::zeros_like(share[i]));
      gradients[i] = torch::cat(parts).to(device_);
    }
    torch::autograd::backward(outputs, gradients);
  }

  // Phases half a second on; undefined where no loss asks for them.
  template <typename Input>
  Tensor later_logits(const Weights& weights, const ModelCondition& encoded, const Input& input) const {
    if (run_.loss.lambda_phase <= 0.0 || !encoded.phase_logits.defined()) return {};
    return classify(run_.config, weights, input());
  }

  Tensor total_loss(Lane& lane, const Tensor& clean, const Tensor& phase_logits, const Tensor& next) {
    WindowBatch& batch = lane.now.windows;
    const DstarLoss& w = run_.loss;
    const Tensor plan = units_->physical(clean), wanted = wanted_of(batch);
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
    if (next.defined()) {
      const Tensor phase = phase_loss(w, phase_logits, tensor_of_ints(batch.phase), next);
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
        const Tensor flat = gradient.cpu().contiguous();
        std::copy(flat.data_ptr<float>(), flat.data_ptr<float>() + n, at);
        gradient.reset();
      } else {
        std::fill(at, at + n, 0.0F);
      }
      at += n;
    }
  }

  void apply() {
    const int n = state_.weights.size();
    const Eigen::Map<const Eigen::VectorXf> g(gradient_.data(), n);
    const float norm = g.norm();
    const float scale = norm > AdamStep::kNorm ? AdamStep::kNorm / norm : 1.0F;
    const AdamStep step{step_, rate(), run_.average};
    dense_kernels().adam(n, gradient_.data(), scale, static_cast<float>(step.corrected_rate()),
                         static_cast<float>(step.correction()), state_.m.data(), state_.v.data(),
                         state_.weights.data());
    const auto keep = static_cast<float>(step.kept());
    Eigen::Map<Eigen::VectorXf> average(state_.average.data(), n);
    average = keep * average + (1.0F - keep) * Eigen::Map<const Eigen::VectorXf>(state_.weights.data(), n);
  }

  DstarData data_;
  DstarRun run_;
  torch::Device device_;  // of the networks while they learn
  LearningState state_;   // behind that of `network_` where there is one
  std::unique_ptr<DeviceNetwork> network_;
  std::vector<float> gradient_;
  std::vector<double> alpha_bar_;
  std::vector<Window> windows_, validation_windows_;
  WindowStatistics statistics_;
  std::unique_ptr<Units> units_;
  std::vector<std::unique_ptr<Lane>> lanes_;
  WindowBatch validation_;
  Tensor validation_noise_;
  long step_ = 0, drawn_ = -1;  // the step of which the lanes hold windows
};

void Trainer::save(double minutes) {
  if (network_) network_->read(state_);
  SafeTensors file;
  file.metadata = {{"format", kFormat},
                   {"robot_digest", data_.robot->digest},
                   {"config", to_json_text(run_.config)},
                   {"seed", std::to_string(run_.seed)},
                   {"step", std::to_string(step_)},
                   {"minutes", fmt::format("{}", minutes)},
                   {"best", fmt::format("{}", best)},
                   {"until", std::to_string(run_.until)},
                   {"stale", std::to_string(stale)}};
  for (const auto& [name, values] : normalisers()) file.tensors[name] = tensor_of(*values);
  const int n = state_.weights.size();
  const auto add = [&](const char* name, const float* values) {
    file.tensors[name] = tensor_of(Eigen::Map<const Eigen::VectorXf>(values, n));
  };
  add("weights", state_.weights.data());
  add("average", state_.average.data());
  add("adam.m", state_.m.data());
  add("adam.v", state_.v.data());
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
  expect_text(file, "format", kFormat, path);
  expect(path, "robot", data_.robot->digest, text_of(file, "robot_digest", path));
  expect(path, "configuration", to_json_text(run_.config), text_of(file, "config", path));
  expect(path, "seed", std::to_string(run_.seed), text_of(file, "seed", path));
  const auto load = [&](const char* name, float* out) {
    const Eigen::VectorXf values = vector_of(file, name, state_.weights.size(), path);
    std::copy(values.begin(), values.end(), out);
  };
  for (const auto& [name, values] : normalisers()) *values = vector_of(file, name, values->size(), path);
  units_ = std::make_unique<Units>(statistics_, *data_.language, leads());
  load("weights", state_.weights.data());
  load("average", state_.average.data());
  load("adam.m", state_.m.data());
  load("adam.v", state_.v.data());
  to_device();
  step_ = static_cast<long>(number_of(file, "step", path));
  // In another part there are other demonstrations: validations are counted anew.
  if (const auto part = file.metadata.find("until");
      part != file.metadata.end() && part->second == std::to_string(run_.until)) {
    best = number_of(file, "best", path);
    stale = static_cast<int>(number_of(file, "stale", path));
  }
  return number_of(file, "minutes", path);
}

}  // namespace

DstarEnd train_dstar(const DstarData& data, const DstarRun& run,
                     const std::function<void(const DstarProgress&)>& report, const std::function<bool()>& stop) {
  Trainer trainer(data, run);
  const double minutes = trainer.restore();
  DstarLog log(run, trainer.steps(), minutes);
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

bool can_train_dstar() { return true; }

void need_dstar_trainer() {}

}  // namespace duet
