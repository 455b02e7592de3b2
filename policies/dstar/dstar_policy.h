// D-STAR as a policy: observation and prompt -> five anchors at 5 Hz. Also what its ablations and the plain Diffusion
// Policy are: networks of other configurations in the same class.
#pragma once

#include <array>
#include <deque>
#include <memory>
#include <span>

#include "duet/core/file.h"
#include "duet/policies/dstar/network.h"
#include "duet/policies/language.h"
#include "duet/policies/policy.h"

namespace duet {

enum class NoiseMode {
  kEpisode,  // x_T drawn once per episode: successive plans are of one mode
  kCall,     // drawn anew at each call
  kLead,     // as kCall where the command says that the robot begins, none where it answers
};

struct DstarSampling {
  NoiseMode noise = NoiseMode::kEpisode;
  double temperature = 0.0;  // deviation of x_T; 0: the plan is a function of what is seen (docs/deviations.md, P24)
};

// `name`: as rows and tables show it. The network and the encoder are shared between episodes and threads.
std::unique_ptr<Policy> make_dstar_policy(const std::string& name, std::shared_ptr<const RobotModel> robot,
                                          std::shared_ptr<const DstarNetwork> network,
                                          std::shared_ptr<const LanguageEncoder> language,
                                          const DstarSampling& sampling = {});

// The entry of "dstar" or "dp": options `network` (braced: the default, student, or a file), `language` (NPZ table;
// default: built in), `noise` (episode | call | lead), `temperature`. Throws what load_dstar_network and
// load_language_table throw; MissingError where the file is not there.
PolicyInfo dstar_info(const std::string& name);
PolicyMaker dstar_maker(const std::string& name, std::shared_ptr<const RobotModel> robot, const PolicyOptions& options);
LoadedFiles dstar_files(const std::string& name, const PolicyOptions& options);

// The past that D-STAR's long stream looks back on: frames further apart, kept over an episode, of which an observation
// only brings the newest. One owner, not thread-safe.
class PastFrames {
 public:
  // `stride`: ticks between the frames, 1 or more.
  explicit PastFrames(int stride) : stride_(stride) {}
  void reset() { seen_.clear(); }
  // Keeps the frames of an observation; what was kept of its ticks or later ones is replaced.
  void add(const Observation& observation);
  // kHistoryFrames frames, `stride` ticks apart, the newest last. For a tick that was not seen: the last one before it,
  // or the first of all. Valid until the next call. Throws std::invalid_argument before the first add.
  std::span<const ObservationFrame> frames();

 private:
  struct Seen {
    int tick;
    ObservationFrame frame;
  };
  int stride_;
  std::deque<Seen> seen_;  // oldest first
  std::array<ObservationFrame, kHistoryFrames> frames_;
};

}  // namespace duet
