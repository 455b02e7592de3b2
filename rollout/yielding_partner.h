// A person who gives way: what the clip does is what they want, and a passive body lies between it and the skin that
// the robot touches. Trunk and legs shift together over the floor; head, upper arms and forearms with hands hang on
// them by springs and dampers and keep their bones' lengths. Untouched, they are where the clip has them.
// Not modelled: reflexes, a step back, a trunk that bends, wrists, any intention. Feet slide with the trunk.
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>

#include "duet/backends/backend.h"
#include "duet/core/robot_state.h"
#include "duet/robots/human_body.h"

namespace duet {

// Orders of magnitude for an adult, with their sources; docs/deviations.md, E7, says how far each was checked.

// Effective masses of ISO/TS 15066 [kg]. The head's is the standard's 4.4 kg in the middle of its capsule, which lies
// beyond the joint.
inline constexpr double kYieldingTrunkMass = 40.0, kYieldingHeadMass = 7.4, kYieldingForearmMass = 2.0,
                        kYieldingHandMass = 0.6;
// Stiffness of hand and elbow against the trunk [N/m]: measured endpoint stiffness of relaxed arms is 100 to 400 N/m
// (Mussa-Ivaldi, Hogan and Bizzi 1985; Dolan, Friedman and Nagurka 1993). Share of critical damping: about a quarter
// (Perreault, Kirsch and Crago 2004).
inline constexpr double kYieldingArmStiffness = 300.0, kYieldingArmDamping = 0.25;
// Stiffness of the head against the trunk: about 15 N m/rad of the neck over 0.15 m, an estimate [N/m]; damping as the
// arms'.
inline constexpr double kYieldingHeadStiffness = 600.0;
// Spring and damper of the trunk, pushed 1.2 m above the floor: what a standing person's ankles give beyond gravity,
// about a third of m g h = 700 N m/rad, and 350 N m s/rad (Peterka 2002) [N/m], [N s/m].
inline constexpr double kYieldingTrunkStiffness = 160.0, kYieldingTrunkDamping = 240.0;
// How far the trunk gives way at most: young adults withstood 16.2 cm (SD 2.6) of the floor's displacement without a
// step (PMC6338353). There they stand as a solid person does [m].
inline constexpr double kYieldingMostShift = 0.16;
// The law is stable with the skin's springs and dampers up to this physics step [s].
inline constexpr double kYieldingLongestStep = 0.002;

// One owner. Copying copies the state.
class YieldingPartner {
 public:
  // `dt`: physics step [s]. Throws std::invalid_argument above kYieldingLongestStep.
  YieldingPartner(const HumanBody& human, double dt);

  void reset();
  // Sets where the person wants to be from here on: joints now and their velocities [m], [m/s], frame W.
  void lead(const HumanJoints& joints, const HumanJoints& velocities);
  // After a physics step: everybody has moved on, and these forces act next.
  void step(std::span<const Contact> contacts);
  // Plans the coming step. False where nobody has touched them since the reset: they are where the clip has them.
  bool plan();

  // Now, and towards the end of the coming step [m], [m/s].
  [[nodiscard]] HumanJoints joints() const { return wanted_ + spread(shift_); }
  [[nodiscard]] HumanJoints velocities() const { return wanted_velocities_ + spread(velocity_); }
  [[nodiscard]] HumanJoints displacement() const { return spread(shift_); }  // from the clip's joints [m]
  [[nodiscard]] bool touched() const { return touched_; }
  // Kinetic energy of the displacement's velocity and that of the springs [J].
  [[nodiscard]] double energy() const;
  [[nodiscard]] Eigen::Vector3d momentum() const;  // of the displacement's velocity [kg m/s]

 private:
  static constexpr int kParts = 6;
  using Parts = Eigen::Matrix<double, 3, kParts>;
  using Weights = Eigen::Matrix<double, kParts, kParts>;

  [[nodiscard]] static HumanJoints spread(const Parts& parts);
  void feel(const Contact& contact);
  void keep_bones(const Weights& level, const Weights& upright, Parts& shift) const;

  HumanBody human_;
  double dt_;
  HumanJoints wanted_ = HumanJoints::Zero(), wanted_velocities_ = HumanJoints::Zero();
  Parts shift_ = Parts::Zero(), velocity_ = Parts::Zero(), force_ = Parts::Zero();
  std::array<double, kParts> resistance_{};  // of the skin that touches, as the step sees it [kg]
  bool touched_ = false;
};

}  // namespace duet
