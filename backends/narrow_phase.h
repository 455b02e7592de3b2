// Where the robot touches the ground, the human and itself: closed forms for spheres, capsules and the plane z = 0, the
// same for every engine that takes contacts from outside. Friction and skin are those of the pair, so no engine's rule
// for combining two bodies' values matters. Buffers are sized on construction; the order of points is that of the
// shapes, so a continuation does not depend on history.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <span>
#include <vector>

#include "duet/backends/backend.h"
#include "duet/core/robot_state.h"
#include "duet/robots/human_body.h"
#include "duet/robots/kinematics.h"

namespace duet {

// The partner as engines see it: joints that move on at constant velocity between two calls of set_partner, and the
// pose and the velocity of each capsule. No allocation.

struct MovingPartner {
  bool present = false;  // false until set: engines keep its capsules where they touch nothing
  HumanJoints joints = HumanJoints::Zero();
  HumanJoints velocities = HumanJoints::Zero();

  void set(const HumanJoints& new_joints, const HumanJoints& new_velocities);
  void advance(double dt) { joints += dt * velocities; }

  // For snapshots: kValues numbers, appended or read back.
  static constexpr int kValues = 1 + 2 * 3 * 24;
  void append_to(std::vector<double>& values) const;
  void read_from(std::span<const double> values);
};

// The axis of a capsule along z of its frame, as RobotShape has it.
struct CapsulePose {
  Pose X_WC;
  double half_length = 0.0;  // [m], without caps
};
CapsulePose capsule_pose(const HumanCapsule& capsule, const HumanJoints& joints);

// Velocity of the point of the capsule nearest to p_W: linear between the velocities of its ends (a spin about its own
// axis is not known from joints). [m/s], frame W.
Eigen::Vector3d capsule_velocity(const HumanCapsule& capsule, const MovingPartner& partner, const Eigen::Vector3d& p_W);

struct ContactPoint {
  int link = -1;  // as in Contact: of the robot, touched by the other side
  ContactSide side = ContactSide::kGround;
  int other = -1;
  Eigen::Vector3d p_W = Eigen::Vector3d::Zero();   // in the middle of the overlap [m]
  Eigen::Vector3d n_W = Eigen::Vector3d::UnitZ();  // unit, from the other side towards the link
  double depth = 0.0;                              // > 0 [m]
  double friction = 0.0;
  ContactCompliance skin = {};                          // of a human contact; elsewhere the engine's own rigid contact
  Eigen::Vector3d v_other_W = Eigen::Vector3d::Zero();  // of the human or the ground at p_W [m/s]; not of a link
};

// A contact as it is reported. `f_W`: force of the other side on the link [N].
Contact reported(const ContactPoint& point, const Eigen::Vector3d& f_W);

class NarrowPhase {
 public:
  // Keeps the robot model alive. `human_contacts`: the most that are kept with the human; the default is more than a
  // body's surface takes at once.
  explicit NarrowPhase(const Scene& scene, std::size_t human_contacts = 64);

  // Touching points of the links at these poses. Valid until the next call.
  std::span<const ContactPoint> collide(const Kinematics& kinematics, const MovingPartner& partner);
  std::span<const ContactPoint> collide(std::span<const Eigen::Matrix3d> R_WL, std::span<const Eigen::Vector3d> p_WL,
                                        const MovingPartner& partner);
  [[nodiscard]] std::span<const ContactPoint> points() const { return points_; }
  // More points than this cannot occur on the ground and the declared pairs; with the human it is the most that are
  // kept (a std::runtime_error says so beyond it).
  [[nodiscard]] std::size_t capacity() const { return points_.capacity(); }

 private:
  struct Segment {  // of a shape or capsule, in W
    Eigen::Vector3d a = Eigen::Vector3d::Zero(), b = Eigen::Vector3d::Zero(), center = Eigen::Vector3d::Zero();
    double radius = 0.0, reach = 0.0;  // of a sphere around it
  };
  void collide_ground();
  void collide_self();
  void collide_human(const MovingPartner& partner);
  void add(const ContactPoint& point);

  std::shared_ptr<const RobotModel> robot_;
  HumanBody human_;
  PartnerMode mode_;
  PairFriction friction_;
  bool self_collision_;
  std::vector<Segment> shapes_, capsules_;
  std::vector<Eigen::Matrix3d> R_LS_;
  std::vector<ContactPoint> points_;
};

// Nearest points of segments a1 b1 and a2 b2. For parallel ones: the middle of where they run side by side.
struct NearestPoints {
  Eigen::Vector3d p1, p2;
};
NearestPoints nearest_points(const Eigen::Vector3d& a1, const Eigen::Vector3d& b1, const Eigen::Vector3d& a2,
                             const Eigen::Vector3d& b2);

// An episode that begins with bodies inside one another would be thrown apart: refused by name in every engine alike.
// A light touch at the start (soles, a hand on a shoulder) is allowed.

inline constexpr double kRobotOverlap = 0.03;    // of a declared pair, or of a link with the ground [m]
inline constexpr double kPartnerOverlap = 0.10;  // of a link with a capsule of the solid partner [m]

// For Backend::reset. Throws std::invalid_argument naming the deepest overlap beyond kRobotOverlap.
void refuse_robot_overlap(const Scene& scene, const RobotState& state);
// Whether a link lies deeper than kPartnerOverlap in the solid partner; false for a partner of another mode.
bool is_in_partner(const Scene& scene, const RobotState& state, const HumanJoints& joints);
// For the first Backend::set_partner after a reset: the same for the solid partner and kPartnerOverlap. A partner of
// another mode is never refused.
void refuse_partner_overlap(const Scene& scene, const RobotState& state, const HumanJoints& joints);

}  // namespace duet
