// Contacts and joint stops of one step as soft unilateral rows with Coulomb's cone, seen through an inertia A = M + S
// (backends/physics_backend.h). For engines without a contact solver of their own.
// With the velocity v0 that the step would end with, the impulses p [N s] and the velocity u of the other side,
//   v = v0 + A^-1 J^T p,   0 <= p_n  complementary to  n (J v - u) + cfm p_n / dt - erp depth / dt >= 0,
//   |p_t| <= friction p_n, against the slip where equal.
// Where all contacts stick, one factorisation gives the answer. Else block Gauss-Seidel finds which ones open or slide,
// and a linear system the impulses of that, until both agree. No history: equal input gives bitwise equal output. No
// allocation after construction.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "duet/backends/narrow_phase.h"
#include "duet/robots/dynamics.h"

namespace duet {

// The softness of a row: the share of the depth that one step removes, and the compliance [m/(N s)].
struct ConstraintSoftness {
  double erp = 1.0;
  double cfm = 0.0;
};
// The softness of a spring [N/m] and a damper [N s/m] in parallel, taken implicitly over dt. Both 0: no force.
ConstraintSoftness spring_damper(double stiffness, double damping, double dt);

class ContactSolver {
 public:
  // `contacts`: the most that are added for one step, stops apart. `sweeps`: the most of Gauss-Seidel. Keeps a
  // reference to the model, which must outlive it.
  ContactSolver(const RobotModel& robot, std::size_t contacts, double dt, int sweeps);

  void clear();
  // A touching point; with the poses of all links.
  void add(const ContactPoint& point, const ConstraintSoftness& softness, std::span<const Eigen::Matrix3d> R_WL,
           std::span<const Eigen::Vector3d> p_WL);
  // The stop of a joint, which pushes towards `side`: +1 at the lower stop, -1 at the upper. `depth` [rad] is how far
  // it is passed; a negative one is a gap, which the step may close. At most one a joint.
  void add_stop(int joint, double side, double depth, const ConstraintSoftness& softness);

  // The generalised velocity (robots/kinematics.h) from v0 to v, with the factor of A.
  void solve(const TreeFactor& factor, Eigen::VectorXd& v);

  [[nodiscard]] std::size_t size() const { return used_; }  // contacts and stops, in the order in which they were added
  [[nodiscard]] Eigen::Vector3d impulse(std::size_t i) const { return rows_[i].axes_W * rows_[i].p; }  // on the link, W
  [[nodiscard]] double stop_impulse(std::size_t i) const { return rows_[i].p.x(); }  // >= 0, towards its side [N m s]
  [[nodiscard]] const Eigen::VectorXd& generalized_impulse() const { return generalized_; }  // J^T p

 private:
  enum class Mode { kOpen, kStick, kSlide };
  struct Row {                        // a contact: its normal and two tangents; a stop has the first only
    std::vector<int> support;         // entries of the generalised velocity that matter to it, falling
    TreeFactor::Triple J, Y;          // Jacobian transposed and L^-T times that, A = L^T L; zero outside the support
    Eigen::Matrix3d axes_W, inverse;  // directions as columns; Y^T Y, the inverse inertia along them
    Eigen::Vector3d target, missing;  // velocities wanted, and less those of v0 [m/s]
    double friction = 0.0, compliance = 0.0;
    Eigen::Vector3d p;
    Mode mode = Mode::kOpen;
    Eigen::Vector2d drag;  // of a sliding contact: direction of its friction
    int at = 0;            // of its first unknown in the linear system
  };
  Row& next_row(const ConstraintSoftness& softness);
  void add_link(Row& row, int link, double sign, const Eigen::Vector3d& p_W, std::span<const Eigen::Matrix3d> R_WL,
                std::span<const Eigen::Vector3d> p_WL) const;
  void project(const TreeFactor& factor, const Eigen::VectorXd& v);
  void assemble();
  bool stick();
  void slide();
  double sweep();
  bool settle();
  void guess_modes();
  bool solve_modes();
  bool correct_modes();
  void write_half();

  const RobotModel* robot_;
  double dt_;
  int sweeps_;
  std::size_t used_ = 0;
  std::vector<Row> rows_;
  // Over all rows, where they are few: the inverse inertia, a system in some of them, its solution, all impulses.
  Eigen::MatrixXd G_, system_;
  Eigen::VectorXd unknowns_, p_, missing_, change_of_rows_;
  Eigen::VectorXd half_, generalized_, change_;  // L^-T J^T p, J^T p, A^-1 J^T p
};

}  // namespace duet
