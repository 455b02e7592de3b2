#include "duet/training/dstar/torch/losses.h"

#include "duet/robots/kinematics.h"

namespace duet {
namespace {

using torch::Tensor;
using Plan = Eigen::Map<const Eigen::Matrix<float, kAnchorSize, 1>>;
using Points = Eigen::Map<const Eigen::Matrix<float, 3, kLossPoints>>;

constexpr double kStay = 0.95;  // of T_valid: a phase goes on for half a second

Eigen::Quaterniond rotation_of(const Plan& plan) { return Eigen::Quaterniond(plan[3], plan[4], plan[5], plan[6]); }

void place(const RobotModel& robot, const Plan& plan, Kinematics& kinematics) {
  const Pose X_EB{rotation_of(plan).normalized(), plan.head<3>().cast<double>()};
  kinematics.update(X_EB, robot.neutral + plan.tail(robot.dof()).cast<double>());
}

// Gradient of a plan from the gradients of its points: sums of forces and moments over the tree.
void pull_back(const RobotModel& robot, const std::vector<int>& frames, const Kinematics& kinematics, const Plan& plan,
               const Points& gradient, float* out) {
  Eigen::Map<Eigen::Matrix<float, kAnchorSize, 1>> result(out);
  Eigen::Matrix<double, kAnchorSize, 1> sum = Eigen::Matrix<double, kAnchorSize, 1>::Zero();
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const Eigen::Vector3d force = gradient.col(static_cast<Eigen::Index>(i)).cast<double>();
    const Eigen::Vector3d point = kinematics.frame_position(frames[i]);
    sum.head<3>() += force;
    moment += (point - kinematics.p_WL(0)).cross(force);
    for (int link = robot.frames[frames[i]].link; link > 0; link = robot.links[link].parent) {
      const Eigen::Vector3d axis = kinematics.R_WL(link) * robot.links[link].axis;
      sum[6 + link] += axis.dot((point - kinematics.p_WL(link)).cross(force));
    }
  }
  // A turn d of R changes the unit quaternion q by (0, d) q / 2, hence the gradient 2 (0, moment) q, which is at right
  // angles to q: normalisation only divides by the length.
  const Eigen::Quaterniond q = rotation_of(plan);
  const Eigen::Quaterniond g = Eigen::Quaterniond(0.0, moment.x(), moment.y(), moment.z()) * q.normalized();
  sum.segment<4>(3) = 2.0 / q.norm() * Eigen::Vector4d(g.w(), g.x(), g.y(), g.z());
  result = sum.cast<float>();
}

class ForwardKinematics : public torch::autograd::Function<ForwardKinematics> {
 public:
  static Tensor forward(torch::autograd::AutogradContext* context, const Tensor& plans, std::int64_t robot_address) {
    const auto& robot = *reinterpret_cast<const RobotModel*>(robot_address);
    context->saved_data["robot"] = robot_address;
    const Tensor values = plans.contiguous();
    context->save_for_backward({values});
    const std::vector<int> frames = loss_frames(robot);
    Kinematics kinematics(robot);
    Tensor points = torch::empty({values.size(0), kLossPoints, 3});
    auto* out = points.data_ptr<float>();
    for (std::int64_t i = 0; i < values.size(0); ++i) {
      place(robot, Plan(values.data_ptr<float>() + kAnchorSize * i), kinematics);
      for (const int frame : frames)
        for (const double x : kinematics.frame_position(frame)) *out++ = static_cast<float>(x);
    }
    return points;
  }

  static torch::autograd::tensor_list backward(torch::autograd::AutogradContext* context,
                                               const torch::autograd::tensor_list& gradients) {
    const auto& robot = *reinterpret_cast<const RobotModel*>(context->saved_data["robot"].toInt());
    const Tensor values = context->get_saved_variables()[0], gradient = gradients[0].contiguous();
    const std::vector<int> frames = loss_frames(robot);
    Kinematics kinematics(robot);
    Tensor result = torch::empty_like(values);
    for (std::int64_t i = 0; i < values.size(0); ++i) {
      const Plan plan(values.data_ptr<float>() + kAnchorSize * i);
      place(robot, plan, kinematics);
      pull_back(robot, frames, kinematics, plan, Points(gradient.data_ptr<float>() + 3 * kLossPoints * i),
                result.data_ptr<float>() + kAnchorSize * i);
    }
    return {result, Tensor()};
  }
};

// (N, P, 3), (N, Q, 3) -> (N, P, Q)
Tensor distances(const Tensor& a, const Tensor& b) {
  return ((a.unsqueeze(2) - b.unsqueeze(1)).square().sum(-1) + 1e-8).sqrt();
}

// First row of the rotation's x axis in E, level: where the robot looks.
Tensor heading(const Tensor& q) {
  const Tensor w = q.select(-1, 0), x = q.select(-1, 1), y = q.select(-1, 2), z = q.select(-1, 3);
  return torch::stack({1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z)}, -1);
}

Tensor face_loss(const Tensor& plan, const Tensor& partner_root) {
  const Tensor q = plan.slice(-1, 3, 7);
  const Tensor forward = heading(q / (q.norm(2, -1, true) + 1e-8));
  const Tensor to_partner = partner_root.slice(1, 0, 2).unsqueeze(1) - plan.slice(-1, 0, 2);
  const Tensor cosine = (forward * to_partner).sum(-1) / ((forward.norm(2, -1) * to_partner.norm(2, -1)) + 1e-6);
  return (1.0 - cosine).mean();
}

// P(next phase) that T_valid allows from a phase: to stay or to go on.
Tensor valid_transitions() {
  return torch::tensor({{kStay, 1.0 - kStay, 0.0}, {0.0, kStay, 1.0 - kStay}, {0.0, 0.0, 1.0}}, torch::kFloat32);
}

}  // namespace

torch::Tensor forward_kinematics(const std::shared_ptr<const RobotModel>& robot, const torch::Tensor& plans) {
  return ForwardKinematics::apply(plans, reinterpret_cast<std::int64_t>(robot.get()));
}

torch::Tensor action_loss(const DstarLoss& weights, const torch::Tensor& plan, const torch::Tensor& wanted) {
  const torch::Tensor square = (plan - wanted).square();
  return (weights.translation * square.slice(-1, 0, 3).sum(-1) + weights.rotation * square.slice(-1, 3, 7).sum(-1) +
          weights.joints * square.slice(-1, 7).sum(-1))
      .mean();
}

torch::Tensor auxiliary_loss(const DstarLoss& weights, const std::shared_ptr<const RobotModel>& robot,
                             const torch::Tensor& plan, const torch::Tensor& wanted, const torch::Tensor& partner,
                             const torch::Tensor& partner_root) {
  const torch::Tensor points = forward_kinematics(robot, plan.reshape({-1, kAnchorSize}));
  torch::Tensor true_points;
  {
    const torch::NoGradGuard guard;
    true_points = forward_kinematics(robot, wanted.reshape({-1, kAnchorSize}));
  }
  const torch::Tensor people = partner.reshape({-1, kLossPoints, 3});
  const torch::Tensor position = (points - true_points).square().sum(-1).mean();
  const torch::Tensor spatial =
      (distances(points, people) - distances(true_points, people)).square().sum({1, 2}).mean();
  return weights.face * face_loss(plan, partner_root) + weights.position * position + weights.spatial * spatial;
}

torch::Tensor phase_loss(const DstarLoss& weights, const torch::Tensor& logits, const torch::Tensor& phase,
                         const torch::Tensor& next_logits) {
  torch::Tensor loss = weights.classification * torch::nll_loss(torch::log_softmax(logits, 1), phase);
  if (!next_logits.defined()) return loss;
  const torch::Tensor allowed =
      torch::matmul(torch::softmax(logits.slice(0, 0, next_logits.size(0)), 1), valid_transitions());
  const torch::Tensor found = torch::log_softmax(next_logits, 1);
  return loss + weights.transition * (allowed * ((allowed + 1e-8).log() - found)).sum(1).mean();
}

}  // namespace duet
