// Controls: scripted policies that no score may reward. Each does something simple (stand with a raised hand, walk up,
// follow the nearest hand, go through every gesture, copy the partner), and all but two are blind to the command. A
// score that one of them wins measures less than its name says. Thread-safe.
#pragma once

#include <array>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "duet/policies/arm_reach.h"
#include "duet/policies/policy.h"

namespace duet {

// The parts of which a control is made.
enum class ControlGesture { kNone, kBow, kWave, kKiss, kShake, kHighFive, kHug };

struct ControlScript {
  std::string_view name = {}, about = {};
  double distance = 0.0;                           // it walks up to so far from the partner's root [m]; 0: stands
  int follows = -1;                                // hand at the partner's nearest hand: 0 left, 1 right, -1 none
  bool forward = false;                            // both arms are held out
  bool raised = false;                             // the right hand is held up
  ControlGesture gesture = ControlGesture::kNone;  // again and again, with the right hand
  bool all_gestures = false;                       // one after the other, in rounds
  double lean_in = 0.0;                            // [m] nearer at the end of each such round
  bool waits = false;                              // begins once the partner has raised a hand or leans, unless told to
  double apart = 0.0;                              // where it waits, as `distance` [m]; 0: at `distance`
  bool once = false;                               // a gesture is done once, a hand is served while it is raised
  bool embraces = false;                           // both arms are opened, and close where it has come near
  bool mirrors = false;                            // both arms and the trunk do as the partner's
  bool told = false;                               // does what its task's row in the source says
  bool preset = false;  // by the clock alone, as a maker's arm action: a wave and a kiss end, what touches is held 20 s
};

// `omni`, `canned`, `servo`, `raised`, `walker`, `forward`, `patient`, `mirror`, `waiting`, `vendor`.
std::span<const ControlScript> control_scripts();

// Whether a policy of that name is one of them.
bool is_control(std::string_view policy);
std::vector<std::string> control_names();

// Throws std::invalid_argument for a name that is none and for a robot without arms (card: roles.arms, tracks).
PolicyMaker control_maker(std::string_view name, std::shared_ptr<const RobotModel> robot);

class ControlPolicy final : public Policy {
 public:
  ControlPolicy(std::shared_ptr<const RobotModel> robot, const ControlScript& script);
  [[nodiscard]] std::string_view name() const override { return name_; }
  void reset(const EpisodeContext& context) override;
  Anchors act(const Observation& observation) override;
  // At 50 Hz, since a wave is too quick for anchors.
  std::vector<Reference> plan(const Observation& observation) override;

 private:
  // Where the robot is and where its partner.
  struct Place {
    Eigen::Vector3d root;     // [m], frame W
    double yaw, face;         // of the robot; towards the partner [rad]
    Eigen::Vector2d towards;  // unit, level
    double distance;          // of the roots, level [m]
  };
  // Joint angles that an arm reaches, over all joints.
  struct Poses {
    std::array<Eigen::VectorXd, 2> forward;
    std::array<Eigen::VectorXd, 2> open, closed;
    Eigen::VectorXd raised, wave_out, wave_in, mouth, blown, offered, shaken;
  };

  [[nodiscard]] static Place place(const ObservationFrame& frame);
  [[nodiscard]] Eigen::VectorXd pose(double seconds) const;
  // Arms of a preset action, into `q`.
  void act_preset(double seconds, Eigen::VectorXd& q) const;
  [[nodiscard]] double gesture_time(double seconds) const;  // since its begin [s]
  [[nodiscard]] double bow(double seconds) const;           // 0 upright to 1
  [[nodiscard]] Reference reference(const Place& place, double seconds, double ahead) const;
  void follow(const ObservationFrame& frame);
  void mirror(const ObservationFrame& frame, const Place& place);
  // Looks whether the partner has begun; one that does not wait is awake from the begin.
  void watch(const ObservationFrame& frame, int tick);
  void copy_arm(int side, const Eigen::VectorXd& from, double share, Eigen::VectorXd& q) const;

  std::shared_ptr<const RobotModel> robot_;
  std::string_view name_;
  ControlScript script_, now_;  // as declared; for this episode's task
  ArmReach arms_;
  Poses poses_;
  Eigen::VectorXd followed_;  // joints of the arms that follow or mirror
  HandWatch partner_;
  double least_lean_ = 0.0;  // of the partner's trunk so far [rad]
  bool awake_ = false;
  double begun_ = 0.0;    // when it awoke [s]
  double closing_ = 0.0;  // of an embrace, 0 open to 1
  double served_ = 1.0;   // share of the way that a hand which follows goes
  double leaning_ = 0.0;  // of a mirrored trunk, as bow()
  RobotState start_;
};

}  // namespace duet
