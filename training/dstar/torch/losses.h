// The losses of A.3.1 on predicted plans.
#pragma once

#include <torch/torch.h>

#include <memory>

#include "duet/training/dstar/trainer.h"

namespace duet {

// Plans (N, 36) as encode_plan has them -> places of loss_frames in E (N, kLossPoints, 3), differentiable. Quaternions
// need not be unit.
torch::Tensor forward_kinematics(const std::shared_ptr<const RobotModel>& robot, const torch::Tensor& plans);

// Mean over windows and anchors of w_trans |dp|^2 + w_rot |dq|^2 + w_dof |dtheta|^2; plans (B, 5, 36), physical units.
torch::Tensor action_loss(const DstarLoss& weights, const torch::Tensor& plan, const torch::Tensor& wanted);

// w_face L_face + w_pos L_pos + w_spatial L_spatial. `partner`: (B, 5, kLossPoints, 3) in E, at the anchors' times;
// `partner_root`: (B, 3), now.
torch::Tensor auxiliary_loss(const DstarLoss& weights, const std::shared_ptr<const RobotModel>& robot,
                             const torch::Tensor& plan, const torch::Tensor& wanted, const torch::Tensor& partner,
                             const torch::Tensor& partner_root);

// w_cls L_cls + w_phase_KL L_trans. `next_logits`: of the same windows half a second later, or undefined. The valid
// transitions of half a second: stay, or go on to the next phase (docs/deviations.md).
torch::Tensor phase_loss(const DstarLoss& weights, const torch::Tensor& logits, const torch::Tensor& phase,
                         const torch::Tensor& next_logits);

}  // namespace duet
