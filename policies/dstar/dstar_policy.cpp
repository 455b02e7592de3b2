#include "duet/policies/dstar/dstar_policy.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <optional>
#include <utility>

#include "duet/core/field.h"
#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "duet/core/share.h"
#include "duet/policies/scheduler.h"

namespace duet {
namespace {

using Robot = std::shared_ptr<const RobotModel>;

// Whether the scheduler takes it: finite, its quaternion unit.
bool is_reference(const Reference& reference) {
  constexpr double kUnit = 1e-6;
  return reference.X_WB.p.allFinite() && std::abs(reference.X_WB.R.norm() - 1.0) < kUnit && reference.q.allFinite();
}

class DstarPolicy final : public Policy {
 public:
  DstarPolicy(std::string name, Robot robot, std::shared_ptr<const DstarNetwork> network,
              std::shared_ptr<const LanguageEncoder> language, const DstarSampling& sampling)
      : name_(std::move(name)),
        robot_(std::move(robot)),
        network_(std::move(network)),
        language_(std::move(language)),
        sampling_(sampling),
        maker_(robot_),
        past_(network_->config.long_stride),
        runner_(network_) {}

  [[nodiscard]] std::string_view name() const override { return name_; }

  void reset(const EpisodeContext& context) override {
    const std::string prompt = command(context);
    if (prompt == task_prompt(context.task))  // else the words say what to do
      require_known_task(name_, kPaperTasks, context.task);
    if (network_->config.language_on) embedding_ = language_->embed(prompt);
    random_ = Random(context.seed, stream_key({"policy", "noise"}));
    const bool leads = is_leading(context.prompt);
    draws_each_ = sampling_.noise == NoiseMode::kCall || (sampling_.noise == NoiseMode::kLead && leads);
    deviation_ = sampling_.noise == NoiseMode::kLead && !leads ? 0.0 : sampling_.temperature;
    draw();
    drawn_ = true;
    past_.reset();
    faults_ = {};
  }

  Anchors act(const Observation& observation) override {
    require(drawn_, "policy '{}': reset comes first", name_);
    if (draws_each_) draw();
    past_.add(observation);
    maker_.make(observation, past_.frames(), features_);
    const std::span<const float> plan = runner_.run({.features = &features_, .language = embedding_, .noise = noise_});
    return decode_plan(plan, ego_frame(observation.now().robot), *robot_);
  }

  std::vector<Reference> plan(const Observation& observation) override {
    // A frame that is not finite may be clipped into one that is.
    if (!is_finite(observation)) return leave_out(faults_, name_, observation.tick, "the observation is not finite");
    const Anchors anchors = act(observation);
    if (!std::ranges::all_of(anchors, is_reference))
      return leave_out(faults_, name_, observation.tick, "the network's plan is not finite");
    return densify(anchors);
  }

  [[nodiscard]] PolicyFaults faults() const override { return faults_; }

 private:
  // A network that learnt only to answer is told what it knows.
  [[nodiscard]] std::string command(const EpisodeContext& context) const {
    const std::string prompt(task_prompt(context.task));
    if (context.prompt.empty()) return prompt;
    return context.prompt == leading_prompt(prompt) && !network_->notes.contains(kBegins) ? prompt : context.prompt;
  }
  void draw() {
    for (float& value : noise_) value = static_cast<float>(deviation_ * random_.normal());
  }

  std::string name_;
  Robot robot_;                                      // shared with the backend and the controller of the same episode
  std::shared_ptr<const DstarNetwork> network_;      // shared: many episodes run one
  std::shared_ptr<const LanguageEncoder> language_;  // likewise
  DstarSampling sampling_;
  FeatureMaker maker_;
  PastFrames past_;
  DstarRunner runner_;
  DstarFeatures features_;
  std::vector<float> embedding_, noise_ = std::vector<float>(kPlanSize);
  Random random_{0, 0};
  PolicyFaults faults_;
  double deviation_ = 0.0;  // of x_T in this episode
  bool drawn_ = false, draws_each_ = false;
};

// A network that ships, and what its file's name has behind the policy's.
struct ShippedNetwork {
  std::string_view name, suffix;
};
constexpr std::array kShipped = {ShippedNetwork{"braced", "_braced"}, ShippedNetwork{"lead", "_lead"},
                                 ShippedNetwork{"student", ""}};

// The options of a suite; an empty language is the one that is built in.
struct DstarOptions {
  std::string network{kShipped.front().name}, language;
  DstarSampling sampling;
};

const FieldTable<DstarOptions>& dstar_options() {
  using O = DstarOptions;
  static const FieldTable<O> table = {
      duet::field<O>(
          {.name = "network",
           .meaning =
               "braced, lead (learnt from a robot that answers its partner, and begins where the command says so) "
               "or student (the oldest), or the path of a network"},
          &O::network),
      duet::field<O>({.name = "language", .meaning = "path of an NPZ table of prompts and their embeddings"},
                     &O::language),
      duet::field<O>(
          {.name = "noise",
           .meaning =
               "where temperature is not 0, x_T is drawn once an episode; call: anew for each plan; lead: anew for "
               "each plan where the command says that the robot begins, none elsewhere",
           .choices = {"episode", "call", "lead"}},
          [](auto& o) -> auto& { return o.sampling.noise; }),
      duet::field<O>(
          {.name = "temperature",
           .meaning = "deviation of x_T, 0 (the most likely plan) to 1 (plans as they are distributed)",
           .range = {0.0, 1.0}},
          [](auto& o) -> auto& { return o.sampling.temperature; })};
  return table;
}

DstarOptions read_dstar_options(const std::string& name, const PolicyOptions& options) {
  return read_options("policy", name, dstar_options(), options);
}

std::string network_path(const std::string& name, const DstarOptions& options) {
  const auto* const shipped = std::ranges::find(kShipped, options.network, &ShippedNetwork::name);
  if (shipped == kShipped.end())
    return first_existing(fmt::format("network of policy '{}' (option 'network')", name), {options.network});
  return share_file(fmt::format("network of policy '{}' (option 'network' names another)", name),
                    fmt::format("policies/dstar/{}{}.safetensors", name, shipped->suffix));
}

// "" for the encoder that is built in.
std::string language_path(const std::string& name, const DstarOptions& options) {
  if (options.language.empty()) return "";
  return first_existing(fmt::format("language table of policy '{}' (option 'language')", name), {options.language});
}

std::shared_ptr<const LanguageEncoder> language_of(const std::string& name, const DstarOptions& options) {
  const std::string path = language_path(name, options);
  return path.empty() ? built_in_language() : load_language_table(path);
}

void check_language(const std::string& name, const DstarNetwork& network, const LanguageEncoder* language) {
  if (!network.config.language_on) return;
  require(language != nullptr, "policy '{}': its network needs a language encoder", name);
  require(network.language == language->name() && network.config.language == language->size(),
          "policy '{}': expected the language encoder of its network ('{}', {} numbers), found '{}' with {}", name,
          network.language, network.config.language, language->name(), language->size());
}

}  // namespace

std::unique_ptr<Policy> make_dstar_policy(const std::string& name, Robot robot,
                                          std::shared_ptr<const DstarNetwork> network,
                                          std::shared_ptr<const LanguageEncoder> language,
                                          const DstarSampling& sampling) {
  require(robot != nullptr, "policy '{}' needs a robot", name);
  require(network != nullptr, "policy '{}' needs a network", name);
  require(network->joints == robot->joint_names(),
          "policy '{}': its network was made for other joints than those of robot '{}'", name, robot->name);
  check_language(name, *network, language.get());
  return std::make_unique<DstarPolicy>(name, std::move(robot), std::move(network), std::move(language), sampling);
}

PolicyInfo dstar_info(const std::string& name) {
  const bool baseline = name == "dp";
  return {name,
          baseline ? "Diffusion Policy: D-STAR's head on one stream of frames and the command, without its reasoning"
                   : "D-STAR of the supplement: phase attention, spatial reasoning and language, by diffusion",
          option_list<PolicyOption>(dstar_options(), {.language = std::string(kBuiltInLanguage), .sampling = {}})};
}

LoadedFiles dstar_files(const std::string& name, const PolicyOptions& given) {
  const DstarOptions options = read_dstar_options(name, given);
  LoadedFiles files = {{"network", network_path(name, options)}};
  if (const std::string language = language_path(name, options); !language.empty())
    files.push_back({"language", language});
  return files;
}

PolicyMaker dstar_maker(const std::string& name, Robot robot, const PolicyOptions& given) {
  require(robot != nullptr, "policy '{}' needs a robot", name);
  const DstarOptions options = read_dstar_options(name, given);
  const std::shared_ptr<const LanguageEncoder> language = language_of(name, options);
  const std::shared_ptr<const DstarNetwork> network = load_dstar_network(network_path(name, options), *robot);
  check_language(name, *network, language.get());
  return [=, robot = std::move(robot), sampling = options.sampling] {
    return make_dstar_policy(name, robot, network, language, sampling);
  };
}

void PastFrames::add(const Observation& observation) {
  const int count = static_cast<int>(observation.history.size()), first = observation.tick - count + 1;
  while (!seen_.empty() && seen_.back().tick >= first) seen_.pop_back();
  for (int i = 0; i < count; ++i) seen_.push_back({first + i, observation.history[i]});
  // One at or before the oldest tick looked at is kept, for ticks that were not seen.
  const int oldest = observation.tick - (kHistoryFrames - 1) * stride_;
  while (seen_.size() > 1 && seen_[1].tick <= oldest) seen_.pop_front();
}

std::span<const ObservationFrame> PastFrames::frames() {
  require(!seen_.empty(), "D-STAR's past: no observation yet");
  for (int i = 0; i < kHistoryFrames; ++i) {
    const int tick = seen_.back().tick - (kHistoryFrames - 1 - i) * stride_;
    const auto later = std::ranges::upper_bound(seen_, tick, {}, &Seen::tick);
    frames_[i] = (later == seen_.begin() ? later : std::prev(later))->frame;
  }
  return frames_;
}

}  // namespace duet
