// The only writer to the robot: reads its states, keeps the state machine, limits what the planner asks for,
// builds and sends the frame. A pure function of what was received and of the caller's clock but for its transport;
// tick() allocates nothing. One owner, one thread. docs/hardware.md, "Guard".
#pragma once

#include <array>
#include <functional>
#include <optional>

#include "duet/hardware/executors/executor.h"
#include "duet/hardware/guard/person_track.h"
#include "duet/hardware/guard/walker.h"
#include "duet/hardware/safety/contact_watch.h"
#include "duet/hardware/safety/foot_load.h"
#include "duet/hardware/safety/joint_watch.h"
#include "duet/hardware/safety/limiter.h"
#include "duet/hardware/safety/safety_machine.h"
#include "duet/hardware/wire/datagram_socket.h"
#include "duet/hardware/wire/robot_wire.h"
#include "duet/hardware/wire/sealed_datagram.h"
#include "duet/hardware/wire/sender_clock.h"

namespace duet {

struct GuardSetup {
  LimiterSetup limiter;  // its dt is the guard's period
  SafetyRules rules;
  int mode_machine = 5;     // that the robot has to report
  JointCommand stance;      // of the joints that the limiter does not move: targets and gains
  double gain_ramp = 1.0;   // in which the stiffness of all joints rises to its full size once it stands up [s]
  bool arm_gravity = true;  // the weight of the arms is fed forward, as far as the torque's limit leaves room
  bool dry_run = true;
  ExecutorKind executor = ExecutorKind::kTwin;      // for the log
  std::string walker = {};                          // the controller in the guard; for the log
  std::string checklist = {};                       // the form, as JSON; empty: none; for the log
  OdometrySource odometry = OdometrySource::kTwin;  // for the log
  bool has_battery = false;                         // its charge is reported, and an unknown one holds
};

// A planner's message. `sequence` rises (hardware/wire/datagram_socket.h).
struct PlannerMessage {
  std::uint64_t sequence = 0;
  MotionCommand command;
  bool acting = false;            // a task with a touch is on; Engagement says when it may touch
  std::optional<Pose> goal = {};  // of the root, in the frame of odometry: what the velocity leads to; for the log
};

// The status after the last tick, for logs and displays.
struct GuardStatus {
  SafetyMemory safety;
  SafetyOrder order;
  SafetyInput input;
  LimitedCommand limited;
  ClampCounts clamps{};
  ContactReading contact;
  long ticks = 0, states = 0, checksum_faults = 0, tick_faults = 0, number_faults = 0;
  long old_messages = 0;    // of planner or perception, dropped
  long restarts = 0;        // of planner, perception and odometry: streams that were taken again after a pause
  long bad_messages = 0;    // of perception: not finite, or a person who jumped
  PersonCounts person{};    // estimates of a person, by what became of them
  NetworkCounts network{};  // datagrams from other computers, the same
  bool received = false;    // a planner's command was handed to the limiter
  bool restarted = false;   // the limiter began anew, from
  Eigen::VectorXd restart_q;
  bool took_state = false;  // a state came in this tick, whole or not
  LowStateFrame state_frame{};
  double share = 0.0;       // of all speeds, after the distance to a person
  bool sent = false;        // a frame left in this tick
  LowCommandFrame frame{};  // it
};

class RobotGuard {
 public:
  // Throws as Limiter does, and std::invalid_argument for a stance of another size. In a dry run no writer is ever
  // made.
  RobotGuard(const GuardSetup& setup, FrameTransport& transport, VelocitySink& velocity);

  // `now`: reception, by the clock of tick().
  void receive(const PlannerMessage& message, double now);
  void receive(const PersonMessage& message, double now);
  // Counts an estimate, and what became of it.
  void note_estimate(PersonFault fault) { ++status_.person[static_cast<std::size_t>(fault)]; }
  // Datagrams that came over the network so far.
  void note_network(const NetworkCounts& counts) { status_.network = counts; }
  void receive(const OdometrySample& sample);
  void receive(const BatteryReading& battery, double now);
  // Notes that the executor of the commands was heard of at `at`.
  void executor_heard(double at) { next_.executor_at = at; }
  // The operator has armed: arming_refusal() was empty. Ignored in a dry run.
  void arm();
  // Legs and waist are the walker's from when the robot stands until it is damped; without one they keep the stance.
  // Refers to it. Before the first tick.
  void let_walk(Walker& walker) { walker_ = &walker; }
  // Time is counted by the robot's own states (in lock-step): a delay of theirs does not show. Before the first tick.
  void has_robots_clock() { has_own_clock_ = false; }
  // As the stop key does, at the next tick.
  void stop() { stop_asked_ = true; }

  void tick(double now);

  [[nodiscard]] const GuardStatus& status() const { return status_; }
  [[nodiscard]] const RobotReading& reading() const { return reading_; }
  [[nodiscard]] const LimiterInput& limiter_input() const { return input_; }
  [[nodiscard]] const MotionCommand& planned() const { return planner_.command; }
  [[nodiscard]] const PlannerMessage& planner() const { return planner_; }
  [[nodiscard]] const OdometrySample& odometry() const { return odometry_; }
  // The person as a policy sees them at the last tick (PersonTrack::at); false where nobody is tracked.
  bool tracked(HumanJoints& joints) const { return track_.at(next_.now, joints, setup_.rules.person.hold); }
  // Place, speed and heading of odometry, tilt of the IMU, joints of the motors.
  [[nodiscard]] const RobotState& measured() const { return measured_; }
  [[nodiscard]] const JointCommand& joints() const {
    return joints_;
  }  // of the last tick: what is sent while it stands
  [[nodiscard]] const GuardSetup& setup() const { return setup_; }

 private:
  void count_streams();
  void read_states(double now);
  void watch_speeds();
  void watch_joints();
  void read_operator(double now);
  void check_robot();
  void weigh();
  void follow_stance();
  void raise_gains();
  void carry_arms(double now);
  void command(double now);
  void walk(bool planned);
  void keep_walking();
  void restart_limiter(bool planned);
  void send();
  void keep_writer();

  GuardSetup setup_;
  FrameTransport& transport_;
  VelocitySink& velocity_;
  Limiter limiter_;
  ContactWatch contact_;
  FootLoad feet_;
  double carried_ = std::numeric_limits<double>::quiet_NaN();  // RobotHealth
  LimiterState limiter_state_;
  LimiterInput input_;
  PlannerMessage planner_;
  bool planner_is_new_ = false;
  StreamOrder planner_order_, person_order_;
  PersonMessage person_;
  PersonTrack track_;
  Engagement engagement_;
  OdometrySample odometry_;
  BatteryReading battery_;
  double battery_at_ = kNever;
  RobotReading reading_;
  Eigen::VectorXd speed_limits_;                 // of the joints [rad/s]
  std::array<Eigen::VectorXd, 3> speed_shares_;  // of these, in the last states, the newest first
  StateCount count_;
  StateDelay delay_;
  JointWatch watch_;
  RobotState measured_;
  std::vector<AxisState> stance_;  // of all joints, on the way to the stance
  JointCommand joints_;
  double gains_ = 0.0;  // share of their full stiffness that the joints have
  SafetyMemory safety_;
  SafetyInput next_;
  bool armed_ = false, was_planned_ = false, stop_asked_ = false, has_own_clock_ = true;
  int ticks_to_writers_ = 0;
  Walker* walker_ = nullptr;
  const JointCommand* walker_joints_ = nullptr;
  bool walks_ = false, follows_stance_ = false;
  int ticks_to_step_ = 0;
  long unsent_ = 0;  // ticks since a frame last left
  GuardStatus status_;
};

}  // namespace duet
