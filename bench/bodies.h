// Who is on stage: the robot that each controller of a suite was made for, the clips on that robot, and which
// controllers this machine cannot run. Each card is loaded once. Immutable once the clips are there; shared by threads.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "bench/suite.h"
#include "motion/paired_motion.h"
#include "robots/robot_model.h"

namespace duet {

// The motion of another robot with joints of the same names: joints that `body` lacks are dropped, joints that `motion`
// lacks stay at neutral. Of the same joints in the same order: the motion to the bit.
RobotMotion on_body(const RobotMotion& motion, const RobotModel& body);

class Bodies {
 public:
  // Throws as load_robot for the suite's own card and for a card that is broken. A controller whose card or network is
  // not on this machine is absent, not an error; of those in `skipped` only the name is taken.
  explicit Bodies(const Suite& suite, const std::vector<std::string>& skipped = {});

  // Puts the clips, retargeted to nominal(), on every body. Once.
  void take_clips(std::vector<PairedMotion> clips);

  // That clips are retargeted to: the suite's robot, or the one that ships with duet.
  [[nodiscard]] const std::shared_ptr<const RobotModel>& nominal() const { return bodies_.front().robot; }
  // Of a controller of the suite; nominal() for one that is absent.
  [[nodiscard]] const std::shared_ptr<const RobotModel>& robot(const std::string& controller) const;
  [[nodiscard]] const std::vector<PairedMotion>& clips(const std::string& controller) const;
  // Controllers of the suite that cannot run here, with the reason.
  [[nodiscard]] const std::map<std::string, std::string>& absent() const { return absent_; }

 private:
  struct Body {
    std::string card;
    std::shared_ptr<const RobotModel> robot;
    std::vector<PairedMotion> clips;
  };
  std::size_t add(const std::string& card);
  [[nodiscard]] const Body& body(const std::string& controller) const;

  std::vector<Body> bodies_;                  // the nominal first
  std::map<std::string, std::size_t> place_;  // of a controller's body
  std::map<std::string, std::string> absent_;
};

}  // namespace duet
