// The robot that each controller of a suite was made for, the clips and the policies on that robot, and what this
// machine cannot run. Each card, each network and the table of limits is loaded once, here, for all episodes. Immutable
// once the clips are there; shared by threads.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "duet/controllers/catalogue/registry.h"
#include "duet/core/digest.h"
#include "duet/experiment/suite/suite.h"
#include "duet/metrics/contact_limits.h"
#include "duet/motion/paired_motion.h"
#include "duet/policies/catalogue/registry.h"
#include "duet/robots/robot_model.h"

namespace duet {

// A policy on a body: what makes it, or why it cannot be there.
struct PolicyOnBody {
  PolicyMaker make;
  std::string refusal;  // its files are not on this machine; empty where it can
};

// A controller of a suite on the robot that it was made for.
struct ControllerOnBody {
  std::shared_ptr<const RobotModel> robot;  // the nominal one where the controller is absent or was skipped
  LoadedController loaded = {};             // empty there
  std::string refusal = {};                 // why this machine cannot run it; empty where it can
};

class Embodiments {
 public:
  // Throws as load_robot for the suite's own card and for a card that is broken, as policy_maker where a policy does
  // not fit nominal() or its files are broken, and InputError for a file that was replaced since the suite was read.
  // InputError too for programs that are not allowed. A controller or policy whose files are not on this machine is
  // absent, not an error; those in `skipped` are not looked at. `called`: how policies are made that the caller brings,
  // by their names in the suite.
  explicit Embodiments(const Suite& suite, const std::vector<std::string>& skipped_controllers = {},
                       const std::vector<std::string>& skipped_policies = {},
                       const std::map<std::string, PolicyLoader>& called = {});
  Embodiments(const Embodiments&) = delete;  // the specs of a plan point into it
  Embodiments& operator=(const Embodiments&) = delete;

  // Puts the clips, retargeted to nominal(), on every body. Once.
  void take_clips(std::vector<PairedMotion> clips);

  // That clips are retargeted to: the suite's robot, or the one that ships with duet.
  [[nodiscard]] const std::shared_ptr<const RobotModel>& nominal() const { return bodies_.front().robot; }
  // Throws std::out_of_range for a name that the suite does not have.
  [[nodiscard]] const ControllerOnBody& controller(const std::string& name) const { return controllers_.at(name); }
  // None where no partner is solid.
  [[nodiscard]] const std::optional<ContactLimits>& limits() const { return limits_; }
  // Digests of the files that were loaded, of the bytes that are used.
  [[nodiscard]] const FileDigests& read() const { return read_; }
  // Sentences of what was loaded, each once: what of a URDF is not simulated, where two files of a controller disagree.
  [[nodiscard]] const std::vector<std::string>& notes() const { return notes_; }
  // The robot of a controller of the suite; nominal() for one that is absent.
  [[nodiscard]] const std::shared_ptr<const RobotModel>& robot(const std::string& name) const {
    return controller(name).robot;
  }
  // The clips on nominal(), and on the robot of a controller.
  [[nodiscard]] const std::vector<PairedMotion>& clips() const { return bodies_.front().clips; }
  [[nodiscard]] const std::vector<PairedMotion>& clips(const std::string& controller) const;
  // Controllers of the suite that cannot run here, with the reason.
  [[nodiscard]] const std::map<std::string, std::string>& absent() const { return absent_; }
  // Policies of the suite that cannot run here, with the reason.
  [[nodiscard]] const std::map<std::string, std::string>& absent_policies() const { return absent_policies_; }
  // The policy on the body of a controller; null for one that was skipped.
  [[nodiscard]] const PolicyOnBody* policy(const std::string& controller, const std::string& policy) const;

 private:
  struct Body {
    std::string card;
    std::shared_ptr<const RobotModel> robot;
    std::vector<PairedMotion> clips;
  };
  std::size_t add(const std::string& card);
  void take_notes(const std::vector<std::string>& notes);
  void load_controller_of(const Suite& suite, const SuiteController& controller);
  void add_policy(const SuitePolicy& policy, const PolicyLoader& load);
  // Called while an exception is handled; throws it again where there is nothing to map.
  void map_policy(const std::string& name, std::size_t place);
  [[nodiscard]] std::size_t place(const std::string& controller) const;

  std::vector<Body> bodies_;                  // the nominal first
  std::map<std::string, std::size_t> place_;  // of a controller's body
  std::map<std::string, ControllerOnBody> controllers_;
  std::optional<ContactLimits> limits_;
  FileDigests read_;
  std::vector<std::string> notes_;
  std::map<std::string, std::string> absent_, absent_policies_;
  std::map<std::pair<std::string, std::size_t>, PolicyOnBody> policies_;  // by name and body
};

// Which programs a suite or a plan would start or talk to, and whether the user allowed it (docs/trust.md): a suite, or
// the run of somebody else, is data until the user says otherwise. Thread-safe.

// A policy of a suite that is a program of its own, or a training of a plan.
struct NamedProgram {
  std::string who;       // "policy 'wave_policy'", "training 'plain-1'"
  std::string file;      // that names it: a descriptor, a plan
  std::string action;    // "runs 'python3 wave_policy.py' in '/folder'" or "connects to 'localhost:7000'"
  bool trusted = false;  // the file lies in a trusted folder
};

// Programs of the suite's policies but those in `skipped`. Throws InputError for a descriptor that is broken.
std::vector<NamedProgram> programs_of(const Suite& suite, const std::vector<std::string>& skipped = {});
// Programs of one policy; none where it is no descriptor, or one of a network.
std::vector<NamedProgram> programs_of(const SuitePolicy& policy);
// A program that `file` names and that runs in the file's folder.
NamedProgram program_in(const std::string& who, const std::string& file, const std::vector<std::string>& command);

// One line for each: "policy 'wave_policy' of FILE runs 'python3 wave_policy.py' in 'FOLDER'".
std::string describe(const NamedProgram& program);

// Throws InputError with the list where there is a program that is neither allowed nor in a trusted folder.
void require_allowed(const std::vector<NamedProgram>& programs, bool allowed);

// Whether a descriptor and the folder that its program runs in both lie in a folder of $DUET_TRUSTED_FOLDERS (absolute
// paths with ':' between them), links followed.
bool in_trusted_folder(const std::string& descriptor);

}  // namespace duet
