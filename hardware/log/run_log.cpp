#include "duet/hardware/log/run_log.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <optional>

#include "duet/core/file.h"
#include "duet/core/json.h"
#include "duet/core/require.h"
#include "duet/core/share.h"
#include "duet/hardware/log/frame_cdr.h"
#include "duet/hardware/safety/limiter_setup_json.h"

namespace duet {
namespace {

constexpr std::size_t kSlots = 4096;  // of the ring: 8 s of ticks
constexpr std::uint16_t kSetupChannel = 1, kTickChannel = 2, kFrameChannel = 3, kEventChannel = 4, kStateChannel = 5;

const McapChannel kChannels[] = {
    {kSetupChannel, "guard/setup", "json", "", "", ""},
    {kTickChannel, "guard/tick", kTickEncoding, "", "", ""},
    {kFrameChannel, "rt/lowcmd", "cdr", "unitree_hg::msg::dds_::LowCmd_", "omgidl",
     "module unitree_hg { module msg { module dds_ {\n"
     "struct MotorCmd_ { octet mode; float q; float dq; float tau; float kp; float kd; unsigned long reserve; };\n"
     "struct LowCmd_ { octet mode_pr; octet mode_machine; MotorCmd_ motor_cmd[35]; unsigned long reserve[4]; "
     "unsigned long crc; };\n};};};\n"},
    {kEventChannel, "guard/events", "json", "", "", ""},
    {kStateChannel, "rt/lowstate", "cdr", "unitree_hg::msg::dds_::LowState_", "omgidl",
     "module unitree_hg { module msg { module dds_ {\n"
     "struct IMUState_ { float quaternion[4]; float gyroscope[3]; float accelerometer[3]; float rpy[3]; short "
     "temperature; };\n"
     "struct MotorState_ { octet mode; float q; float dq; float ddq; float tau_est; short temperature[2]; float vol; "
     "unsigned long sensor[2]; unsigned long motorstate; unsigned long reserve[4]; };\n"
     "struct LowState_ { unsigned long version[2]; octet mode_pr; octet mode_machine; unsigned long tick; IMUState_ "
     "imu_state; MotorState_ motor_state[35]; octet wireless_remote[40]; unsigned long reserve[4]; unsigned long crc; "
     "};\n};};};\n"}};

template <std::size_t N>
void put(const Eigen::VectorXd& from, double (&to)[N]) {
  std::copy_n(from.data(), N, to);
}

template <std::size_t N>
void get(const double (&from)[N], Eigen::VectorXd& to) {
  to = Eigen::Map<const Eigen::VectorXd>(from, N);
}

void put_root(const VelocityCommand& root, double (&to)[4]) {
  const double values[4] = {root.forward, root.lateral, root.yaw_rate, root.height};
  std::copy_n(values, 4, to);
}

void put_pose(const Pose& pose, double (&to)[7]) {
  std::copy_n(pose.p.data(), 3, to);
  std::copy_n(pose.R.coeffs().data(), 4, to + 3);
}

std::uint64_t flag_if(bool set, TickFlag flag) { return set ? static_cast<std::uint64_t>(flag) : 0; }

std::uint64_t nanoseconds(double seconds) { return static_cast<std::uint64_t>(std::llround(1e9 * seconds)); }

std::span<const std::byte> bytes_of_text(const std::string& text) { return std::as_bytes(std::span(text)); }

bool same_bits(const double* a, const double* b, std::size_t count) {
  return std::memcmp(a, b, count * sizeof(double)) == 0;
}

bool same_output(const TickRecord& record, const LimitedCommand& out) {
  double root[4];
  put_root(out.root, root);
  return same_bits(root, record.sent_root, 4) && same_bits(out.q.data(), record.sent_q, kG1Motors) &&
         same_bits(out.kp.data(), record.sent_kp, kG1Motors) && same_bits(out.kd.data(), record.sent_kd, kG1Motors);
}

// Passes ticks through a limiter of the log's own setup.
class LimiterReplay {
 public:
  explicit LimiterReplay(const LimiterSetup& setup)
      : limiter_(setup), state_(limiter_.start(setup.robot->standing_state())) {
    input_.state = setup.robot->standing_state();
  }
  bool agrees(const TickRecord& record) {
    read_record(record, input_, person_, command_);
    if ((record.flags & kTickRestarted) != 0) {
      get(record.restart_q, restart_);
      limiter_.restart(restart_, state_);
    }
    limiter_.tick((record.flags & kTickReceived) != 0 ? &command_ : nullptr, input_, state_, out_, counts_);
    return same_output(record, out_);
  }

 private:
  Limiter limiter_;
  LimiterState state_;
  LimiterInput input_;
  HumanJoints person_;
  MotionCommand command_;
  LimitedCommand out_;
  ClampCounts counts_{};
  Eigen::VectorXd restart_;
};

}  // namespace

TickRecord record_of(const RobotGuard& guard) {
  const LimiterInput& input = guard.limiter_input();
  const GuardStatus& status = guard.status();
  TickRecord r{};
  r.now = status.input.now;
  r.flags = flag_if(input.odometry, kTickOdometry) | flag_if(input.person != nullptr, kTickPerson) |
            flag_if(input.acting, kTickActing) | flag_if(input.release, kTickRelease) |
            flag_if(status.received, kTickReceived) | flag_if(status.restarted, kTickRestarted) |
            flag_if(guard.planner().goal.has_value(), kTickGoal);
  put_pose(input.state.X_WB, r.root_pose);
  std::copy_n(input.state.v_WB.data(), 3, r.root_velocity);
  std::copy_n(input.state.w_WB_B.data(), 3, r.root_gyro);
  put(input.state.q, r.q);
  put(input.state.v, r.v);
  r.share = input.share;
  r.person_speed = input.person_speed;
  if (input.person != nullptr) std::copy_n(input.person->data(), std::size(r.person), r.person);
  put(status.restart_q, r.restart_q);
  r.stamp = guard.planned().stamp;
  put_root(guard.planned().root, r.asked_root);
  put(guard.planned().q, r.asked_q);
  put_root(status.limited.root, r.sent_root);
  put(status.limited.q, r.sent_q);
  put(status.limited.kp, r.sent_kp);
  put(status.limited.kd, r.sent_kd);
  if (guard.planner().goal) put_pose(*guard.planner().goal, r.goal);
  std::copy_n(guard.measured().X_WB.R.coeffs().data(), 4, r.tilt);
  return r;
}

void read_record(const TickRecord& r, LimiterInput& input, HumanJoints& person, MotionCommand& command) {
  std::copy_n(r.root_pose, 3, input.state.X_WB.p.data());
  std::copy_n(r.root_pose + 3, 4, input.state.X_WB.R.coeffs().data());
  std::copy_n(r.root_velocity, 3, input.state.v_WB.data());
  std::copy_n(r.root_gyro, 3, input.state.w_WB_B.data());
  get(r.q, input.state.q);
  get(r.v, input.state.v);
  input.odometry = (r.flags & kTickOdometry) != 0;
  std::copy_n(r.person, std::size(r.person), person.data());
  input.person = (r.flags & kTickPerson) != 0 ? &person : nullptr;
  input.person_speed = r.person_speed;
  input.acting = (r.flags & kTickActing) != 0;
  input.release = (r.flags & kTickRelease) != 0;
  input.share = r.share;
  command.stamp = r.stamp;
  command.root = {r.asked_root[0], r.asked_root[1], r.asked_root[2], r.asked_root[3]};
  get(r.asked_q, command.q);
}

RunLog::RunLog(const std::string& path, const GuardSetup& setup)
    : writer_(path, McapChunks::kOneMessage), ring_(kSlots) {
  for (const McapChannel& channel : kChannels) writer_.add(channel);
  const LimiterSetup& limiter = setup.limiter;
  const nlohmann::json json = {
      {"duet", duet_version()},
      {"limiter", limiter_setup_json(limiter)},
      {"odometry", kOdometryNames[static_cast<std::size_t>(setup.odometry)]},
      {"executor",
       executed_channels_json(executed_channels(setup.executor, *limiter.robot, limiter.executed.joints, setup.walker),
                              *limiter.robot)}};
  const std::string text = dumped(json);
  if (!writer_.write(kSetupChannel, 0, 0, bytes_of_text(text)) || !writer_.flush())
    throw StorageError(fmt::format("cannot write '{}'", path));
  thread_ = std::thread([this] { write_slots(); });
}

RunLog::~RunLog() {
  ends_ = true;
  thread_.join();
}

void RunLog::add(const RobotGuard& guard) {
  const std::uint64_t added = added_.load(std::memory_order_relaxed);
  if (added - written_.load(std::memory_order_acquire) >= kSlots) {
    ++dropped_;
    return;
  }
  const GuardStatus& status = guard.status();
  Slot& slot = ring_[added % kSlots];
  slot.tick = record_of(guard);
  slot.took = status.took_state;
  slot.sent = status.sent;
  if (slot.took) slot.received = status.state_frame;
  if (slot.sent) slot.frame = status.frame;
  slot.state = status.safety.state;
  slot.cause = status.safety.cause;
  slot.changed = slot.state != last_state_;
  last_state_ = slot.state;
  slot.dropped = dropped_ - told_;
  told_ += slot.dropped;
  slot.restarts = status.restarts - told_restarts_;
  told_restarts_ += slot.restarts;
  added_.store(added + 1, std::memory_order_release);
}

void RunLog::write_slots() {
  for (bool last = false; !last;) {
    last = ends_;
    const std::uint64_t added = added_.load(std::memory_order_acquire);
    for (std::uint64_t k = written_.load(std::memory_order_relaxed); k < added; ++k) {
      write_slot(ring_[k % kSlots]);
      written_.store(k + 1, std::memory_order_release);
    }
    good_ = writer_.flush();
    if (!last) std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  if (const long rest = dropped_ - told_; rest > 0)
    write_event(nanoseconds(last_.tick.now), last_.state, last_.cause, "dropped", rest);
  good_ = writer_.finish();
}

void RunLog::write_slot(const Slot& slot) {
  const std::uint64_t time = nanoseconds(slot.tick.now);
  ++sequence_;
  if (slot.dropped > 0) write_event(time, last_.state, last_.cause, "dropped", slot.dropped);
  last_ = slot;
  writer_.write(kTickChannel, sequence_, time, std::as_bytes(std::span(&slot.tick, 1)));
  if (slot.took) write_frame(kStateChannel, time, cdr_of(slot.received));
  if (slot.sent) write_frame(kFrameChannel, time, cdr_of(slot.frame));
  if (slot.changed) write_event(time, slot.state, slot.cause);
  if (slot.restarts > 0) write_event(time, slot.state, slot.cause, "restarts", slot.restarts);
}

// A change of state, or that `n` ticks are not in the log here ("dropped"), or `n` streams were taken again after a
// pause ("restarts").
void RunLog::write_event(std::uint64_t time, SafetyState state, StopCause cause, const char* counted, long n) {
  nlohmann::json event = {{"state", safety_state_name(state)}, {"cause", stop_cause_name(cause)}};
  if (counted != nullptr) event[counted] = n;
  writer_.write(kEventChannel, sequence_, time, bytes_of_text(dumped(event)));
}

void RunLog::write_frame(std::uint16_t channel, std::uint64_t time, std::span<const std::byte> frame) {
  writer_.write(channel, sequence_, time, frame);
}

LogReplay replay_log(const std::string& path) {
  const std::string bytes = read_file(path);
  LogReplay replay;
  std::optional<LimiterReplay> limiter;
  const auto each = [&](const McapChannel& channel, const McapMessage& message) {
    const std::string_view text(reinterpret_cast<const char*>(message.data.data()), message.data.size());
    if (channel.topic == "guard/setup") {
      const nlohmann::json json = nlohmann::json::parse(text, nullptr, false);
      if (!json.is_object() || !json.contains("limiter"))
        throw InputError(fmt::format("{}: expected the setup of a limiter, found none", path));
      const LimiterSetup setup = parse_limiter_setup(json["limiter"], path);
      try {
        limiter.emplace(setup);
      } catch (const std::invalid_argument& error) {
        throw InputError(fmt::format("{}: {}", path, error.what()));
      }
    } else if (channel.message_encoding == kTickEncoding) {
      if (!limiter || message.data.size() != sizeof(TickRecord))
        throw InputError(
            fmt::format("{}: expected a setup and ticks of {} bytes, found others", path, sizeof(TickRecord)));
      TickRecord record;
      std::memcpy(&record, message.data.data(), sizeof(record));
      ++replay.ticks;
      replay.different += limiter->agrees(record) ? 0 : 1;
    } else if (channel.topic == "guard/events") {
      replay.events.emplace_back(text);
      const nlohmann::json event = nlohmann::json::parse(text, nullptr, false);
      if (event.is_object() && event.contains("dropped") && event["dropped"].is_number_integer())
        replay.dropped += event["dropped"].get<long>();
    }
  };
  replay.whole = read_mcap(bytes_of_text(bytes), path, each).whole;
  if (!limiter) throw InputError(fmt::format("{}: expected the log of a run, found an MCAP file without one", path));
  return replay;
}

}  // namespace duet
