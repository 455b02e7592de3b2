// The robot's topics, as the guard and as a twin see them; hardware/dds/ has them over DDS. One owner, one thread.
#pragma once

#include <array>
#include <limits>
#include <string>
#include <string_view>

#include "duet/controllers/root_conversion.h"
#include "duet/core/robot_state.h"
#include "duet/hardware/safety/safety_machine.h"
#include "duet/hardware/wire/low_level_frame.h"

namespace duet {

// The robot's battery, as its own topic says.

struct BatteryReading {
  double charge = std::numeric_limits<double>::quiet_NaN();  // [%]
};
// The time for which a reading stands; what is older is not known. The topic is slow [s].
inline constexpr double kBatteryAge = 5.0;

// How the guard reaches the robot's low-level topics; a test has one in memory. The writer of commands is made when the
// robot is armed and not before: what does not exist sends nothing by mistake. One owner, one thread.

class FrameTransport {
 public:
  virtual ~FrameTransport() = default;
  // The next state that has arrived; false where there is none.
  virtual bool take(LowStateFrame& frame) = 0;
  // How many others write commands to this robot now.
  virtual int foreign_writers() = 0;
  // Throws std::runtime_error where the writer cannot be made.
  virtual void open_writer() = 0;
  virtual void close_writer() = 0;
  [[nodiscard]] virtual bool has_writer() const = 0;
  // Without a writer: nothing happens. False where it was not sent.
  virtual bool write(const LowCommandFrame& frame) = 0;
};

// The executor of the root's velocity, beside the low-level topic.
class VelocitySink {
 public:
  virtual ~VelocitySink() = default;
  // Once a tick, after the frame of that tick.
  virtual void send(const VelocityCommand& velocity) = 0;
  // Once a tick, before it.
  virtual void enter(SafetyState) {}
};

// Where the robot's root is and how fast, as somebody measured it. HOMIE measures neither: without a source here the
// law of supplement A.4.3 cannot run, and is refused.

enum class OdometrySource {
  kNone,
  kLegs,      // of IMU, kinematics and the standing foot
  kExternal,  // a tracker in the room
  kVendor,    // the maker's topic, which is there only while the maker's own walking runs
  kTwin,
};
inline constexpr std::array<std::string_view, 5> kOdometryNames = {"none", "legs", "external", "vendor", "twin"};

struct OdometrySample {
  Pose X_WB;                                       // of the base in the frame of odometry
  Eigen::Vector3d v_WB = Eigen::Vector3d::Zero();  // measured, not differenced here [m/s]
  double at = kNever;                              // reception, by this program's clock [s]
  bool valid = false;                              // the source says so
  long sender_restarts = 0;                        // of the source, by its sequence numbers
};

class RobotWire : public FrameTransport {
 public:
  // The newest sample of the maker's odometry topic; false where none has come. Its place and velocity; `at` is left.
  virtual bool take(OdometrySample& sample) = 0;
  // The newest state of the battery; false where none has come.
  virtual bool take(BatteryReading&) { return false; }
  // Takes what the executor of the commands has sent by `now`; when it was last heard of and well, kNever where it was
  // not or does not answer.
  virtual double executor_heard([[maybe_unused]] double now) { return kNever; }
  // Until a state can be taken, at most so long [s]; false where none came.
  virtual bool wait(double) { return false; }
  using FrameTransport::take;
};

class TwinWire {
 public:
  virtual ~TwinWire() = default;
  virtual bool take(LowCommandFrame& frame) = 0;
  virtual void write(const LowStateFrame& frame) = 0;
  virtual void write(const OdometrySample& sample) = 0;
  virtual void write(const BatteryReading&) {}
  // The remote control on its own topic; nothing while it is lost.
  virtual void write(const RemoteControl&) {}
  // The second IMU, on the trunk.
  virtual void write(const ImuFrame&) {}
  // How many write commands now.
  virtual int command_writers() = 0;
  // Until a command can be taken, at most so long [s]; false where none came.
  virtual bool wait(double) { return false; }
};

// Where on a network a robot or a twin is: a domain of DDS and one named interface, never one that the library chooses.

struct DdsPlace {
  int domain = -1;
  std::string interface;  // "eth1", "lo"
};

// Domains of twins. 0 is the robot's; 1 on "lo" is that of unitree_mujoco and of the programs that are tried with it.
inline constexpr int kFirstTwinDomain = 100, kLastTwinDomain = 199, kSimulatorDomain = 1;
// Whether no robot can be there.
bool is_twin_place(const DdsPlace& place);

// Throws std::invalid_argument for a domain outside 0 to 199, and for an interface that is empty, "auto", or no name of
// one.
void check_place(const DdsPlace& place);
// The same, and that it is a twin's: domain 100 to 199, or 1, on "lo".
void check_twin_place(const DdsPlace& place);

}  // namespace duet
