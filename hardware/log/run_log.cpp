#include "duet/hardware/log/run_log.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <utility>

#include "duet/core/file.h"
#include "duet/core/json.h"
#include "duet/core/require.h"
#include "duet/core/share.h"
#include "duet/hardware/log/frame_cdr.h"
#include "duet/hardware/safety/limiter_setup_json.h"
#include "duet/rows/json_fields.h"

namespace duet {
namespace {

constexpr std::size_t kSlots = 4096;  // of the ring: 8 s of ticks
constexpr int kTicksPerHealth = 10;   // 50 Hz
constexpr std::uint16_t kSetupChannel = 1, kTickChannel = 2, kFrameChannel = 3, kEventChannel = 4, kStateChannel = 5,
                        kHealthChannel = 6, kLimiterChannel = 7;
constexpr double kRefusalsEvery = 1.0;  // event of refused estimates [s]

// The maker's messages for readers of ROS 2, whose CDR is that of DDS.
constexpr const char* kCommandSchema =
    "uint8 mode_pr\nuint8 mode_machine\nunitree_hg/MotorCmd[35] motor_cmd\nuint32[4] reserve\nuint32 crc\n"
    "================================================================================\n"
    "MSG: unitree_hg/MotorCmd\n"
    "uint8 mode\nfloat32 q\nfloat32 dq\nfloat32 tau\nfloat32 kp\nfloat32 kd\nuint32 reserve\n";
constexpr const char* kStateSchema =
    "uint32[2] version\nuint8 mode_pr\nuint8 mode_machine\nuint32 tick\nunitree_hg/IMUState imu_state\n"
    "unitree_hg/MotorState[35] motor_state\nuint8[40] wireless_remote\nuint32[4] reserve\nuint32 crc\n"
    "================================================================================\n"
    "MSG: unitree_hg/IMUState\n"
    "float32[4] quaternion\nfloat32[3] gyroscope\nfloat32[3] accelerometer\nfloat32[3] rpy\nint16 temperature\n"
    "================================================================================\n"
    "MSG: unitree_hg/MotorState\n"
    "uint8 mode\nfloat32 q\nfloat32 dq\nfloat32 ddq\nfloat32 tau_est\nint16[2] temperature\nfloat32 vol\n"
    "uint32[2] sensor\nuint32 motorstate\nuint32[4] reserve\n";

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

// Four decimals: a tenth of a millimetre, or of a milliradian.
nlohmann::json rounded(double value) { return number_or_null(std::round(1e4 * value) / 1e4); }

nlohmann::json root_json(const double (&root)[4]) {
  return {{"forward", rounded(root[0])},
          {"lateral", rounded(root[1])},
          {"yaw_rate", rounded(root[2])},
          {"height", rounded(root[3])}};
}

// A tick of the limiter for others to plot: asked for, sent and measured; and how often a command was changed since the
// message before, by reason.
nlohmann::json limiter_json(const TickRecord& tick, const LimiterSetup& setup, double share,
                            const ClampCounts& clamps) {
  nlohmann::json joints = nlohmann::json::object(), changed = nlohmann::json::object();
  for (const int joint : setup.executed.joints)
    joints[setup.robot->joints[joint].name] = {{"measured", rounded(tick.q[joint])},
                                               {"asked", rounded(tick.asked_q[joint])},
                                               {"sent", rounded(tick.sent_q[joint])}};
  for (std::size_t k = 0; k < kClampReasons; ++k) changed[std::string(kClampNames[k])] = clamps[k];
  return {{"time", tick.now},
          {"share", rounded(share)},
          {"root", {{"asked", root_json(tick.asked_root)}, {"sent", root_json(tick.sent_root)}}},
          {"joints", std::move(joints)},
          {"clamps", std::move(changed)}};
}

// Measures how far the joints that follow a target are from it.
void measure_tracking(const LowCommandFrame& frame, const TickRecord& tick, const RobotModel& robot,
                      HealthMessage& message) {
  for (int j = 0; j < kG1Motors; ++j) {
    const double apart = std::abs(static_cast<double>(frame.motor[j].q) - tick.q[j]);
    if (!(frame.motor[j].kp > 0.0F) || apart <= message.health.tracking) continue;
    message.health.tracking = apart;
    message.tracking_joint = robot.joints[j].name;
  }
}

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

PersonGap::PersonGap(const LimiterSetup& setup) : distance_(setup.robot, setup.human, {}) {
  input_.state = setup.robot->standing_state();
}

double PersonGap::measure(const TickRecord& tick) {
  read_record(tick, input_, person_, command_);
  if (input_.person == nullptr || !input_.odometry) return kUnknown;
  const double gap = distance_.measure(input_.state.X_WB, input_.state.q, input_.person, 0.0, false).person;
  return gap < BodyGaps::kFar ? gap : kUnknown;
}

RunLog::RunLog(const std::string& path, const GuardSetup& setup, Watch watch)
    : setup_(setup), watch_(std::move(watch)), writer_(path, McapChunks::kFast), ring_(kSlots), gap_(setup.limiter) {
  add_channels();
  if (!writer_.flush()) throw StorageError(fmt::format("cannot write '{}'", path));
  thread_ = std::thread([this] { write_slots(); });
}

void RunLog::add_channels() {
  const auto json_channel = [&](std::uint16_t id, const char* topic, const char* type, const nlohmann::json& sample) {
    writer_.add({id, topic, "json", type, "jsonschema", dumped(json_schema_of(sample, type))});
  };
  writer_.add({kSetupChannel, "guard/setup", "json", "", "", ""});
  writer_.add({kTickChannel, "guard/tick", kTickEncoding, "", "", ""});
  writer_.add({kFrameChannel, "rt/lowcmd", "cdr", "unitree_hg/msg/LowCmd", "ros2msg", kCommandSchema});
  json_channel(
      kEventChannel, "guard/events", "duet.GuardEvent",
      {{"state", ""}, {"cause", ""}, {"dropped", 0}, {"restarts", 0}, {"refused", 0}, {"kept_out", 0}, {"why", ""}});
  writer_.add({kStateChannel, "rt/lowstate", "cdr", "unitree_hg/msg/LowState", "ros2msg", kStateSchema});
  json_channel(kHealthChannel, "guard/health", "duet.GuardHealth", health_json({}));
  json_channel(kLimiterChannel, "guard/limiter", "duet.LimiterTick", limiter_json({}, setup_.limiter, 0.0, {}));
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
  fill_health(guard, slot.health);
  slot.missing = status.safety.state == SafetyState::kListen ? status.safety.missing : std::string_view();
  slot.clamps = status.clamps;
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
  write_refusals(last_);
  if (!began_) write_setup(0);
  good_ = writer_.finish();
}

void RunLog::write_slot(const Slot& slot) {
  const std::uint64_t time = nanoseconds(slot.tick.now);
  ++sequence_;
  if (!began_) write_setup(time);
  if (slot.dropped > 0) write_event(time, last_.state, last_.cause, "dropped", slot.dropped);
  const double passed = slot.tick.now - last_.tick.now;
  const bool late = began_ && slot.dropped == 0;
  GuardHealth health = slot.health;
  health.late = late ? std::max(passed - setup_.limiter.dt, 0.0) : 0.0;
  widen(health, window_);
  began_ = true;
  last_ = slot;
  writer_.write(kTickChannel, sequence_, time, std::as_bytes(std::span(&slot.tick, 1)));
  if (slot.took) write_frame(kStateChannel, time, cdr_of(slot.received));
  if (slot.sent) write_frame(kFrameChannel, time, cdr_of(slot.frame));
  if (slot.changed) write_event(time, slot.state, slot.cause);
  if (slot.restarts > 0) write_event(time, slot.state, slot.cause, "restarts", slot.restarts);
  if (slot.tick.now - refusals_at_ >= kRefusalsEvery) write_refusals(slot);
  if (ticks_to_health_-- <= 0) write_plain(slot, time);
}

// An event for each reason for which estimates of a person, or datagrams from other computers, were refused since the
// last one.
void RunLog::write_refusals(const Slot& slot) {
  const PersonCounts& counts = slot.health.person;
  for (std::size_t k = 1; k < kPersonFaults; ++k) {
    if (k == static_cast<std::size_t>(PersonFault::kUnseen) || counts[k] == told_person_[k]) continue;
    write_event(nanoseconds(slot.tick.now), slot.state, slot.cause, "refused", counts[k] - told_person_[k],
                kPersonFaultNames[k]);
    refusals_at_ = slot.tick.now;
  }
  told_person_ = counts;
  const NetworkCounts& network = slot.health.network;
  for (std::size_t k = 1; k < kSealRefusals; ++k) {
    if (network[k] == told_network_[k]) continue;
    write_event(nanoseconds(slot.tick.now), slot.state, slot.cause, "kept_out", network[k] - told_network_[k],
                kSealRefusalNames[k]);
    refusals_at_ = slot.tick.now;
  }
  told_network_ = network;
}

void RunLog::write_setup(std::uint64_t time) {
  const LimiterSetup& limiter = setup_.limiter;
  nlohmann::json setup = {{"duet", duet_version()},
                          {"limiter", limiter_setup_json(limiter)},
                          {"odometry", kOdometryNames[static_cast<std::size_t>(setup_.odometry)]},
                          {"executor", executed_channels_json(executed_channels(setup_.executor, *limiter.robot,
                                                                                limiter.executed.joints, setup_.walker),
                                                              *limiter.robot)}};
  if (!setup_.checklist.empty()) setup["checklist"] = nlohmann::json::parse(setup_.checklist);
  write_json(kSetupChannel, time, setup);
}

// The messages that others plot, for the ticks since the last one.
void RunLog::write_plain(const Slot& slot, std::uint64_t time) {
  ticks_to_health_ = kTicksPerHealth - 1;
  HealthMessage message{window_, std::string(slot.missing), "", std::string(next_key(slot.state, slot.health.stands))};
  if (slot.health.doubtful_joint >= 0)
    message.doubtful_joint = setup_.limiter.robot->joints[slot.health.doubtful_joint].name;
  message.health.left_out = dropped_;
  message.health.distance = gap_.measure(slot.tick);
  if (slot.sent) measure_tracking(slot.frame, slot.tick, *setup_.limiter.robot, message);
  window_ = {};
  const std::string text = dumped(health_json(message));
  writer_.write(kHealthChannel, sequence_, time, bytes_of_text(text));
  if (watch_) watch_(text);
  ClampCounts clamps = slot.clamps;
  for (std::size_t k = 0; k < kClampReasons; ++k) clamps[k] -= told_clamps_[k];
  told_clamps_ = slot.clamps;
  write_json(kLimiterChannel, time, limiter_json(slot.tick, setup_.limiter, slot.health.share, clamps));
}

void RunLog::write_json(std::uint16_t channel, std::uint64_t time, const nlohmann::json& json) {
  const std::string text = dumped(json);
  writer_.write(channel, sequence_, time, bytes_of_text(text));
}

// A change of state, or that `n` ticks are not in the log here ("dropped"), or `n` streams were taken again after a
// pause ("restarts"), or `n` estimates of a person were refused, and `why` ("refused"), or
// datagrams from other computers ("kept_out").
void RunLog::write_event(std::uint64_t time, SafetyState state, StopCause cause, const char* counted, long n,
                         std::string_view why) {
  nlohmann::json event = {{"state", safety_state_name(state)}, {"cause", stop_cause_name(cause)}};
  if (counted != nullptr) event[counted] = n;
  if (!why.empty()) event["why"] = why;
  write_json(kEventChannel, time, event);
}

void RunLog::write_frame(std::uint16_t channel, std::uint64_t time, std::span<const std::byte> frame) {
  writer_.write(channel, sequence_, time, frame);
}

}  // namespace duet
