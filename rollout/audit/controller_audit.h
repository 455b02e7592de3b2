// The audit of a controller's adapter: whether an IO descriptor says of a network what its makers meant. Levels: L0 it
// loads; L1 it agrees with itself; L2 it does what it is told in the physics of its makers, as far as they say which;
// L3 it answers a recorded trace as the makers' program did. Where it does not, other readings of the descriptor
// (controllers/audit/readings.h) are tried, and the one under which the network behaves much better names the defect.
// Not thread-safe.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "duet/controllers/audit/readings.h"
#include "duet/controllers/audit/self_consistency.h"
#include "duet/rollout/audit/trial.h"

namespace duet {

struct AuditSubject {
  Descriptor descriptor;
  std::shared_ptr<const RobotModel> robot;
  ControllerOfReading make;
  TrialPhysics physics{};  // of trial_physics
};

// How well a network does under one reading; lower is better.
struct ReadingScore {
  double asymmetry = 0.0;
  std::vector<TrialResult> trials;    // of trial_tasks, as many as were run
  std::vector<double> costs;          // of each
  [[nodiscard]] double cost() const;  // mean of the trials' costs, and a share of the asymmetry
};

struct NamedDefect {
  ContractPart part = ContractPart::kJointOrder;
  std::string said;   // what the network expects instead
  int line = 0;       // of the descriptor; 0: of none
  double cost = 0.0;  // of the reading
};

struct ReadingSearch {
  std::vector<TrialTask> tasks;
  ReadingScore own;                 // of the descriptor as it stands
  int tried = 0;                    // readings
  std::vector<NamedDefect> better;  // those that are much better, the best first
};

// Tries the descriptor and every other reading of it.
ReadingSearch search_readings(const AuditSubject& subject, const std::string& engine = "mujoco");

// A line of the audit's table.
struct AuditCheck {
  int level = 0;                   // of L0 to L3
  std::string what, found, asked;  // asked: "" where the line is for information
  bool good = true;
};

struct ControllerAudit {
  std::vector<AuditCheck> checks;
  std::vector<NamedDefect> defects;  // the best reading, and up to two that are as good
  std::string verdict;               // sentences: contract or policy
  int readings = 0;                  // other readings that were tried
};

// L1 and L2 of the subject, then the search. Throws as TrialGround and AuditSubject::make.
ControllerAudit audit_controller(const AuditSubject& subject, const std::string& engine = "mujoco");

}  // namespace duet
