// The contact problem that ODE is about to solve, seen through A = M + S (backends/physics_backend.h) instead of M:
// with the velocity v0 that the step would end with and the impulses p of contacts and joint stops,
//   v = v0 + A^-1 J^T p,   0 <= p_n  complementary to  J_n v + cfm p_n / dt - target_n >= 0,
//   |p_t| <= friction p_n along each of two tangents, the first along the slip that v0 would have,
// ODE's own compliance in every row, so that redundant contacts share a load as they do in ODE. Found by pivoting on
// which rows are free; where that cycles, by projected Gauss-Seidel. No history: equal input gives equal bits.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "duet/backends/contact_solver.h"
#include "duet/backends/narrow_phase.h"
#include "duet/robots/dynamics.h"

namespace duet {

class ContactForecast {
 public:
  // `contacts`: the most of one step. Allocates later only where contacts and stops have more rows than ever before and
  // more than a robot's usual. Keeps a reference to the model, which must outlive it.
  ContactForecast(const RobotModel& robot, std::size_t contacts, double dt, int sweeps);

  void clear();
  // With the poses of all links and the velocity that the step would end with without contacts. `normal`: along the
  // normal; `tangential`: compliance of friction [m/(N s)].
  void add(const ContactPoint& point, const ConstraintSoftness& normal, double tangential,
           std::span<const Eigen::Matrix3d> R_WL, std::span<const Eigen::Vector3d> p_WL, const Eigen::VectorXd& v0);
  // The stop of a joint that is passed by `depth` >= 0 [rad]; it pushes towards `side`. After all contacts.
  void add_stop(int joint, double side, double depth, const ConstraintSoftness& softness);

  // The generalised velocity (robots/kinematics.h) from v0 to v, with the factor of A.
  void solve(const TreeFactor& factor, Eigen::VectorXd& v);

  [[nodiscard]] bool empty() const { return used_ == 0; }
  // The axes of contact i, in the order in which contacts were added. Columns: normal, two tangents.
  [[nodiscard]] const Eigen::Matrix3d& axes_W(std::size_t i) const { return parts_[i].axes_W; }
  [[nodiscard]] Eigen::Vector3d impulse(std::size_t i) const;  // on the link, along the axes [N s]
  // The impulse of a joint's stop, towards the inside of the range [N m s]. 0 where none was added.
  [[nodiscard]] double stop_impulse(int joint) const { return stop_impulses_[joint]; }

 private:
  struct Part {                // a contact, or a stop with the first column only
    std::vector<int> support;  // entries of the generalised velocity that matter to it, falling
    TreeFactor::Triple J, Y;   // Jacobian transposed and L^-T times that, A = L^T L; zero outside the support
    Eigen::Matrix3d axes_W;
    int row = 0, rows = 0;
    int joint = -1;
    double side = 0.0;
  };
  enum class Mode : char { kFree, kZero, kHigh, kLow };  // kHigh, kLow: friction at its bound
  struct Row {
    int normal = -1;  // of a tangential row: that of its contact
    double friction = 0.0, compliance = 0.0, target = 0.0;
    Mode mode = Mode::kFree;
  };
  [[nodiscard]] Part new_part() const;
  Part& next_part();
  void add_row(Part& part, double friction, double compliance, double target);
  void add_link(Part& part, int link, double sign, const Eigen::Vector3d& p_W, std::span<const Eigen::Matrix3d> R_WL,
                std::span<const Eigen::Vector3d> p_WL) const;
  void reserve(int rows);
  void project(const TreeFactor& factor, const Eigen::VectorXd& v0);
  bool pivot();
  bool solve_free_rows();
  bool change_modes();
  [[nodiscard]] Mode normal_mode(int row) const;
  [[nodiscard]] Mode tangential_mode(int row) const;
  [[nodiscard]] double still_missing(int row) const;  // of the velocity wanted, under p_
  void settle();
  void gauss_seidel();
  [[nodiscard]] double bound(const Row& row) const { return row.friction * std::max(0.0, p_[row.normal]); }

  const RobotModel* robot_;
  double dt_;
  int sweeps_;
  std::size_t used_ = 0;
  std::vector<Part> parts_;
  std::vector<Row> rows_;
  std::vector<int> free_;
  std::vector<double> stop_impulses_;
  Eigen::MatrixXd G_, work_;               // of all rows, compliance included; of the free ones
  Eigen::VectorXd missing_, p_, reduced_;  // velocities wanted, less those of v0; impulses; of the free rows
  Eigen::VectorXd swept_, change_;
  double small_ = 0.0, slow_ = 0.0;  // what is rounding in p_ and in missing_
};

}  // namespace duet
