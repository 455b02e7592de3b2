// The common part of tasks that two people do: where the two stand for the act, and the scene that an act fills.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "duet/core/numbers.h"
#include "duet/core/task.h"
#include "duet/tasks/synthesis/performer.h"

namespace duet::synthesis {

// Every random quantity of a clip, each from its own Philox stream (seed; task, index, quantity): fixing one of them by
// an option leaves all others as they were. Drawn and given values are recorded as text for the clip's `source`.

// Names of one person's quantities begin with this.
inline constexpr std::array<std::string_view, 2> kWho = {"a.", "b."};

// 10, 50 and 90 % of a quantity over clips.
struct Deciles {
  double low = 0.0, middle = 0.0, high = 0.0;
};

class Draws {
 public:
  // Ranges that follow the style are wider by `breadth` of their width.
  Draws(std::uint64_t seed, Task task, int index, double breadth = 0.0);

  // Uniform in [low, high), or `given` where it is set.
  double uniform(const std::string& quantity, double low, double high, std::optional<double> given = {});
  // A quantity that follows the style (0 ... 1): low + (high - low) * style, give or take a fifth of the range, kept
  // inside it.
  double styled(const std::string& quantity, double style, double low, double high);
  // Through the 10, 50 and 90 % of a distribution, straight in between and a quarter of the last stretch beyond.
  double spread(const std::string& quantity, const Deciles& deciles);
  bool chance(const std::string& quantity, double probability, std::optional<bool> given = {});
  // Exponential: how long it has lasted says nothing of how long it will.
  double memoryless(const std::string& quantity, double mean);
  [[nodiscard]] double breadth() const { return breadth_; }
  [[nodiscard]] Random stream(std::string_view quantity) const;

  void record(const std::string& quantity, double value);
  void record(const std::string& quantity, const std::string& value) { recorded_[quantity] = value; }
  [[nodiscard]] const std::map<std::string, std::string>& recorded() const { return recorded_; }

 private:
  std::uint64_t seed_;
  std::string task_;
  std::string index_;
  double breadth_;
  std::map<std::string, std::string> recorded_;
};

// How people go about an act. `rehearsed`: the way of the first generator, to the bit.
struct MotionStyle {
  bool rehearsed = true;
  double tempo = 1.0;                   // how many times as fast the scene is played as it is planned
  std::optional<double> distance = {};  // of the roots in the act [m]; else the layout's own
  std::optional<double> contact = {};   // of a touch that strikes, at tempo 1 [s]; else the act's own
  // For A and B: where each has the other when its feet stand for the act, from its own facing towards the acting hand,
  // and by how much it then turns away from there, the hand forward. [rad]
  std::array<double, 2> bearing = {0.0, 0.0}, turn = {0.0, 0.0};
};

// The manner of recorded people in an act. docs/synthesis.md says where each figure is from.
struct RecordedManner {
  Deciles tempo = {1.4, 1.7, 2.0};      // of the planned motion
  Deciles act = {};                     // from its begin to its end, at tempo 1 [s]; zeros: as the rehearsed act has it
  Deciles touch = {};                   // of an act with a touch that lasts, its length as played [s]
  double until_touch = 0.0;             // from the act's begin to that touch, at tempo 1 [s]
  Deciles distance = {};                // of the roots in the act [m]; zeros: the layout's own
  Deciles bearing = {-0.2, 0.0, 0.2};   // of either: Manner::bearing, and Manner::turn more, in mid-act [rad]
  Deciles turn = {};                    // Manner::turn, of either [rad]
  Deciles way = {0.0, 0.2, 0.5};        // that both together walk up to each other [m]
  Deciles speed = {0.45, 0.7, 1.0};     // in the middle of such a way [m/s]
  double stands = 0.35;                 // share of people who leave it to the other
  Deciles overlap = {0.1, 0.3, 0.5};    // by which the act begins before the two stand, as played [s]
  Deciles reaction = {0.05, 0.2, 0.5};  // of B to A, as played [s]
  double left = 0.106;                  // share of acts with the left hand
  Deciles before = {0.5, 0.9, 1.4};     // what a recording has before the touch (a gesture's begin) [s]
  Deciles after = {0.2, 0.5, 1.0};      // and after it [s]
  // Nothing of these where recordings of one source are followed:
  Deciles height = {};      // of a body [m]; zeros: as for rehearsed people
  Deciles contact = {};     // of a touch that strikes, as played [s]; zeros: the act's own
  Deciles aside = {};       // of the hips from the trunk and the feet, to either side [rad]
  Deciles stoop = {};       // at which the trunk rests, forward [rad]
  double pause = 0.0;       // mean of a wait without memory between coming and acting [s]
  double breadth = 0.0;     // Draws::breadth
  double both_hands = 0.0;  // share of people who use the other hand, too
  double mirrored = 0.0;    // share of clips that are turned into their mirror image
  double still = 0.0;       // share of gestures before a partner who stands still
};

// The two people who take part, before anybody is placed.
struct Participants {
  std::array<Body, 2> body;  // A, B
  int side = 1;              // of the acting hand: 0 left, 1 right
  double style = 0.5;
  std::optional<double> target_height;  // above the ground [m]
  double farthest = 2.0;                // largest root distance that leaves both a way to walk [m]
  MotionStyle manner = {};
};

// How they stand to each other: A at the origin facing +x, B at (distance, lateral) facing -x turned by `turn`. [m]
struct Layout {
  double distance = 1.0;
  double lateral = 0.0;
  double turn = 0.0;                               // [rad]
  Eigen::Vector3d meet = Eigen::Vector3d::Zero();  // where the hands meet, for acts that have such a point
  std::array<Lean, 2> lean;                        // of the trunks during the act
};

// Two joints within kTouchDistance of each other during [begin, end]. [s]
struct Touch {
  double begin = 0.0, end = 0.0;
  int joint_a = 0, joint_b = 0;
};

struct Scene {
  Participants cast;
  Layout layout;
  std::array<Performer, 2> people;
  double act_begin = 0.0;  // both stand [s]
  double act_end = 0.0;    // contact or gesture is over; arms go back until `release_end`
  double release_end = 0.0;
  std::vector<Touch> touches;
};

struct Act {
  double mean_seconds;       // of the whole clip; Table S6 for the supplement's tasks
  double shortest, longest;  // of the act [s]
  double release;            // until the arms hang again [s]
  double lowest, highest;    // target heights that may be asked for; equal where the task has none [m]
  double touch_distance;     // joints of a contact window are at most this far apart [m]; 0: no contact
  bool close;                // they stand so close that they must step back before they may turn
  Layout (*layout)(const Participants&, Draws&);
  void (*perform)(Scene&, Draws&);
  RecordedManner recorded = {}, varied = {};  // of clips like people, and of those that vary more
};

// Point of a person's frame (origin on the floor below the root, x forward) in W.
Eigen::Vector3d in_world(const Placement& placement, const Eigen::Vector3d& point);
// The same point seen by A and by B of a layout.
Eigen::Vector3d seen_by(int person, const Layout& layout, const Eigen::Vector3d& point_of_a);

// The same two, each having the other where the cast's manner says; the roots keep their distance.
void stand_at_bearings(const Participants& cast, Layout& layout);

// Distance and leans where the distance is given and the hands meet at height `z` between them.
Layout meeting_at_distance(const Participants& cast, double z, double distance, const Lean& lean);
// Distance and leans for hands that meet at height `z`: each reaches with `share` of the arm, but neither less than
// `nearest` nor more than `farthest` in front of the own root.
Layout meeting_layout(const Participants& cast, double z, double share, double nearest, double farthest,
                      const Lean& lean);

}  // namespace duet::synthesis
