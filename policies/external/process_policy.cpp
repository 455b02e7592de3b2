#include "duet/policies/external/process_policy.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>

#include "duet/core/child_process.h"
#include "duet/core/require.h"
#include "duet/policies/external/channel_values.h"
#include "duet/policies/external/message.h"

namespace duet {
namespace {

using std::chrono::milliseconds;
using Result = MessageSocket::Result;
using Type = PolicyMessage::Type;

constexpr const char* kVariable = "DUET_POLICY_FD";
constexpr milliseconds kToEnd{200};  // for a process that has closed its connection or was told goodbye

std::vector<std::string> names_of(const std::vector<int>& joints, const RobotModel& robot) {
  std::vector<std::string> names;
  names.reserve(joints.size());
  for (const int joint : joints) names.push_back(robot.joints[joint].name);
  return names;
}

class ProcessPolicy final : public Policy {
 public:
  ProcessPolicy(const PolicyDescriptor& descriptor, const std::shared_ptr<const RobotModel>& robot,
                const std::vector<int>& joints)
      : descriptor_(descriptor),
        joint_names_(names_of(joints, *robot)),
        channels_(frame_channels()),
        values_(robot, joints, descriptor),
        decoder_(descriptor, robot, joints) {
    descriptor_.socket.empty() ? start() : connect();
    hello_ = hello_message(descriptor_, *robot, joint_names_);
  }

  ~ProcessPolicy() override {
    if (!socket_) return;
    AwakeDeadline at_once(milliseconds(0));
    static_cast<void>(socket_->send(bye_message(), at_once));
    socket_.reset();
    if (child_) static_cast<void>(child_->ended(kToEnd));
  }

  [[nodiscard]] std::string_view name() const override { return descriptor_.name; }
  [[nodiscard]] PolicyFaults faults() const override { return faults_; }

  void reset(const EpisodeContext& context) override {
    require_known_task(descriptor_.name, descriptor_.tasks, context.task);
    held_ = {context.start.X_WB, context.start.q};
    values_.reset(context, {});
    ready_ = false;
    if (faults_.dead) return;
    faults_ = {};
    stop_asked_ = context.stop_asked;
    socket_->stop_when(stop_asked_);
    if (!hello_.empty() && !greet()) return;
    ready_ = exchange(reset_message(context), Type::kReady, "reset").has_value();
  }

  // Where there is no plan: the pose of the last one, at first that of the start.
  Anchors act(const Observation& observation) override {
    const std::vector<Reference> references = plan(observation);
    return anchors_of(references.empty() ? std::vector{held_} : references);
  }

  std::vector<Reference> plan(const Observation& observation) override {
    if (!ready_ || faults_.dead) return {};
    const std::optional<std::string> message = observe(observation);
    if (!message) return invalid("observation: expected finite numbers, found others");
    const std::optional<PolicyMessage> answer = ask(*message, observation.tick);
    if (!answer) return {};
    if (answer->anchors != descriptor_.output.anchors)
      return invalid(fmt::format("plan: expected {} anchors, found {}", descriptor_.output.anchors, answer->anchors));
    DecodedPlan decoded = decoder_.decode(answer->numbers, observation.now().robot);
    if (!decoded.fault.empty()) return invalid(decoded.fault);
    held_ = decoded.references.front();
    return std::move(decoded.references);
  }

 private:
  void start() {
    const SocketPair pair = connected_pair();
    socket_.emplace(pair.ours);
    try {
      child_.emplace(descriptor_.command, descriptor_.folder(), kVariable, pair.theirs);
    } catch (...) {
      close(pair.theirs);
      throw;
    }
    close(pair.theirs);
  }

  void connect() {
    const std::string& address = descriptor_.socket;
    const bool tcp = address.find('/') == std::string::npos && address.find(':') != std::string::npos;
    const std::string path = (std::filesystem::path(descriptor_.folder()) / address).string();
    AwakeDeadline deadline{milliseconds(descriptor_.start_ms)};
    try {
      socket_.emplace(connect_to(tcp ? address : path, deadline));
    } catch (const MissingError& error) {
      die(error.what());
    }
  }

  // Once, when the first episode begins. Whether it may go on.
  bool greet() {
    const auto answer = exchange(hello_, Type::kHello, "hello");
    if (!answer) return false;
    if (answer->version != kPolicyMessageVersion)
      die(fmt::format("hello: expected version {} of the messages, found {}", kPolicyMessageVersion, answer->version));
    else if (!answer->joints.empty() && answer->joints != joint_names_)
      die("hello: expected the joints of the descriptor in its order, found others");
    hello_.clear();
    return !faults_.dead;
  }

  // A message that the policy cannot do without an answer to. Plans that arrive before it are of an earlier episode.
  std::optional<PolicyMessage> exchange(const std::string& message, Type expected, const char* question) {
    AwakeDeadline deadline{milliseconds(descriptor_.start_ms)};
    const auto late = [&] { die(fmt::format("no answer to '{}' within {} ms", question, descriptor_.start_ms)); };
    const Result sent = socket_->send(message, deadline);
    while (std::optional<PolicyMessage> answer = next(sent, deadline, late)) {
      if (answer->type == expected) return answer;
      if (answer->type != Type::kPlan) {
        ++faults_.invalid;
        die(fmt::format("expected '{}', found '{}'", to_string(expected), to_string(answer->type)));
        return std::nullopt;
      }
    }
    if (!faults_.dead && !stopped()) die(fmt::format("no answer to '{}'", question));
    return std::nullopt;
  }

  // The plan for `tick`. Those for earlier ticks come too late and are dropped.
  std::optional<PolicyMessage> ask(const std::string& message, int tick) {
    const bool waits = descriptor_.deadline_ms == 0;
    const int limit = waits ? descriptor_.hang_ms : descriptor_.deadline_ms;
    AwakeDeadline deadline{milliseconds(limit)};
    const auto late = [&] {
      const std::string fault = fmt::format("no plan for tick {} within {} ms", tick, limit);
      if (waits) return die(fault);
      ++faults_.late;
      note(fault);
    };
    const Result sent = socket_->send(message, deadline);
    while (std::optional<PolicyMessage> answer = next(sent, deadline, late)) {
      if (answer->type == Type::kPlan && answer->tick == tick) return answer;
      if (answer->type == Type::kPlan && answer->tick < tick) continue;
      invalid(answer->type == Type::kPlan ? fmt::format("plan: expected tick {}, found {}", tick, answer->tick)
                                          : fmt::format("expected 'plan', found '{}'", to_string(answer->type)));
      return std::nullopt;
    }
    return std::nullopt;
  }

  // The next message; none where a fault was counted. `sent`: how sending the question went.
  template <typename Late>
  std::optional<PolicyMessage> next(Result sent, AwakeDeadline& deadline, const Late& late) {
    std::string text;
    Result result = sent;
    try {
      if (result == Result::kDone) result = socket_->receive(text, deadline);
    } catch (const InputError& error) {  // where the next message would begin is lost
      ++faults_.invalid;
      die(error.what());
      return std::nullopt;
    }
    if (result == Result::kDone && deadline.passed()) result = Result::kLate;
    if (result == Result::kClosed) lose_connection();
    if (result == Result::kLate && !stopped()) late();
    if (result != Result::kDone) return std::nullopt;
    try {
      return parse_policy_message(text);
    } catch (const InputError& error) {
      invalid(error.what());
      return std::nullopt;
    }
  }

  std::optional<std::string> observe(const Observation& observation) {
    if (!is_finite(observation)) return std::nullopt;
    const int frames = static_cast<int>(observation.history.size()), joints = static_cast<int>(joint_names_.size());
    numbers_.clear();
    for (int frame = 0; frame < frames; ++frame)
      for (const Channel& channel : channels_) {
        const std::size_t size = channel_size(channel, {.joints = joints, .actions = 0}), first = numbers_.size();
        numbers_.resize(first + size);
        values_.write(channel, observation, frame, std::span(numbers_).subspan(first));
      }
    if (!std::ranges::all_of(numbers_, [](float number) { return std::isfinite(number); })) return std::nullopt;
    return observe_message(observation.tick, numbers_, frames);
  }

  void lose_connection() {
    const std::optional<std::string> end = child_ ? child_->ended(kToEnd) : std::nullopt;
    die(end ? fmt::format("its process ended with {}", *end) : "its connection was closed");
  }

  [[nodiscard]] bool stopped() const { return stop_asked_ && stop_asked_(); }

  void die(const std::string& message) {
    faults_.dead = true;
    note(message);
    socket_.reset();
    if (child_) child_->kill();
  }

  std::vector<Reference> invalid(const std::string& message) {
    ++faults_.invalid;
    note(message);
    return {};
  }

  void note(const std::string& message) {
    if (faults_.message.empty()) faults_.message = fmt::format("policy '{}': {}", descriptor_.name, message);
  }

  PolicyDescriptor descriptor_;
  std::vector<std::string> joint_names_;  // in the descriptor's order
  std::vector<Channel> channels_;
  ChannelValues values_;
  PlanDecoder decoder_;
  std::vector<float> numbers_;  // of an observation
  Reference held_;
  PolicyFaults faults_;
  std::string hello_;   // until it was answered
  bool ready_ = false;  // the episode's reset was answered
  std::function<bool()> stop_asked_;
  std::optional<MessageSocket> socket_;  // none once the policy is dead
  std::optional<ChildProcess> child_;    // none where a server is asked
};

}  // namespace

std::unique_ptr<Policy> make_process_policy(const PolicyDescriptor& descriptor,
                                            const std::shared_ptr<const RobotModel>& robot) {
  require(robot != nullptr, "policy '{}' needs a robot", descriptor.name);
  return std::make_unique<ProcessPolicy>(descriptor, robot, bind_joints(descriptor, *robot));
}

}  // namespace duet
