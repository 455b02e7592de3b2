// The log of a run: everything that reached the limiter, what it made of it, the frames, and 50 times a second how the
// run is, in one MCAP file (docs/hardware.md, "Log"). A thread of its own writes; the guard's tick only copies into a
// ring, and what finds no room there is counted.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "duet/archives/mcap.h"
#include "duet/core/recording.h"
#include "duet/hardware/guard/robot_guard.h"
#include "duet/hardware/log/guard_health.h"
#include "duet/hardware/safety/contact_watch.h"
#include "duet/robots/robot_model.h"
#include "duet/scoring/recording_scores.h"

namespace duet {

// Inputs and outputs of the limiter at a tick, to the bit. Numbers as in LimiterInput, MotionCommand, LimitedCommand.
struct TickRecord {
  double now;
  std::uint64_t flags;  // TickFlag
  double root_pose[7];  // position, quaternion x, y, z, w
  double root_velocity[3], root_gyro[3];
  double q[kG1Motors], v[kG1Motors];
  double share, person_speed;
  double person[3 * 24];
  double restart_q[kG1Motors];
  double stamp, asked_root[4], asked_q[kG1Motors];
  double sent_root[4], sent_q[kG1Motors], sent_kp[kG1Motors], sent_kd[kG1Motors];
  double goal[7];  // of the planner's root, as root_pose; read where kTickGoal
  double tilt[4];  // the IMU's orientation, quaternion x, y, z, w
};
enum TickFlag : std::uint64_t {
  kTickOdometry = 1,
  kTickPerson = 2,
  kTickActing = 4,
  kTickRelease = 8,
  kTickReceived = 16,
  kTickRestarted = 32,
  kTickGoal = 64,
};
inline constexpr const char* kTickEncoding = "duet.tick/2";

TickRecord record_of(const RobotGuard& guard);
void read_record(const TickRecord& record, LimiterInput& input, HumanJoints& person, MotionCommand& command);

// The person's distance in ticks: of capsules from capsules, where both were measured. One owner.
class PersonGap {
 public:
  explicit PersonGap(const LimiterSetup& setup);
  // [m], below 0 in contact; NaN where person or odometry is not known.
  double measure(const TickRecord& tick);

 private:
  BodyDistance distance_;
  LimiterInput input_;
  HumanJoints person_;
  MotionCommand command_;
};

class RunLog {
 public:
  // Called by the thread that writes, 50 times a second, with a message of "guard/health".
  using Watch = std::function<void(const std::string& text)>;

  // Makes `path`; the first tick brings what the limiter was made of. Throws StorageError.
  RunLog(const std::string& path, const GuardSetup& setup, Watch watch = {});
  ~RunLog();
  RunLog(const RunLog&) = delete;
  RunLog& operator=(const RunLog&) = delete;

  // Adds the guard's last tick. No allocation, no file, no lock.
  void add(const RobotGuard& guard);
  // Ticks that found no room; an event of the log says where and how many ("dropped").
  [[nodiscard]] long dropped() const { return dropped_; }
  [[nodiscard]] bool good() const { return good_; }

 private:
  struct Slot {
    TickRecord tick;
    GuardHealth health;
    std::string_view missing;
    ClampCounts clamps;
    LowStateFrame received;
    LowCommandFrame frame;
    bool took = false, sent = false, changed = false;
    long dropped = 0;   // ticks before it that found no room
    long restarts = 0;  // streams that were taken again since the slot before it
    SafetyState state = SafetyState::kOffline;
    StopCause cause = StopCause::kNone;
  };
  void write_slots();
  void write_slot(const Slot& slot);
  void write_setup(std::uint64_t time);
  void write_refusals(const Slot& slot);
  void write_plain(const Slot& slot, std::uint64_t time);
  void write_json(std::uint16_t channel, std::uint64_t time, const nlohmann::json& json);
  void add_channels();
  void write_event(std::uint64_t time, SafetyState state, StopCause cause, const char* counted = nullptr, long n = 0,
                   std::string_view why = {});
  void write_frame(std::uint16_t channel, std::uint64_t time, std::span<const std::byte> frame);

  GuardSetup setup_;
  Watch watch_;
  McapWriter writer_;
  std::vector<Slot> ring_;
  std::atomic<std::uint64_t> added_ = 0, written_ = 0;
  std::atomic<bool> ends_ = false, good_ = true;
  SafetyState last_state_ = SafetyState::kOffline;
  std::atomic<long> dropped_ = 0;
  long told_ = 0, told_restarts_ = 0;  // by a slot
  PersonCounts told_person_{};         // by an event
  NetworkCounts told_network_{};       // the same
  double refusals_at_ = kNever;        // of that event, by the guard's clock [s]
  Slot last_ = {};                     // that was written
  bool began_ = false;                 // a slot was written
  PersonGap gap_;
  GuardHealth window_;  // since the last message of health
  ClampCounts told_clamps_{};
  long ticks_to_health_ = 0;
  std::uint32_t sequence_ = 0;
  std::thread thread_;
};

// The log of a run as a recording that every metric and detector takes, with the mask of what was executed of the
// reference: what no executor moved cannot be scored as if it had been.

struct LoggedRun {
  Recording recording;  // at 50 Hz, in the frame of odometry; its phases are not known
  ExecutedMask executed;
  std::vector<std::string> events;  // states and causes, in order
  bool whole = false;               // the log has its end
};

// The ticks of a log in which the guard ran or held for a planner with a goal; where none had one, all in which it ran
// or held: the reference's root is then the measured one. The outcome is `fell` where the robot fell (the recording
// ends there), `error` where the guard ended the run for another reason than its operator, and else `ok`.
// Throws as read_run_log() (hardware/log/log_reader.h), and InputError for a log without such ticks.
LoggedRun recording_of_log(const std::string& path, std::optional<Task> task = {});

// Saves the recording with the mask. Throws InputError where the file cannot be written.
void save_logged_run(const Recording& recording, const ExecutedMask& executed, const std::string& path);

}  // namespace duet
