// Recordings that data sets are made of in tests.
#pragma once

#include <string>
#include <vector>

#include "duet/archives/npy/npz.h"
#include "duet/motion/interaction_clip.h"
#include "duet/retarget/options.h"

namespace duet::test {

// A recording as somebody might keep it: positions of named joints, both people, with a label.
inline void write_recording(const std::string& path, const InteractionClip& clip, const std::string& label) {
  Npz npz;
  std::vector<double> values;
  for (int t = 0; t < clip.frames(); ++t)
    for (const HumanMotion* person : {&clip.a, &clip.b})
      for (int j = 0; j < kSmplJoints; ++j)
        for (int axis = 0; axis < 3; ++axis) values.push_back(person->joints.at(t, j)[axis]);
  npz.set("positions", std::move(values), {static_cast<std::size_t>(clip.frames()), 2, kSmplJoints, 3});
  npz.set("joints", std::vector<std::string>(kSmplNames.begin(), kSmplNames.end()));
  npz.set_number("rate_hz", clip.rate_hz());
  if (!label.empty()) npz.set_text("label", label);
  npz.save(path);
}

// Short, so that PAIR takes a moment.
inline PairOptions quick_pair() {
  PairOptions options;
  options.schedule.stage1_iterations = 6;
  options.schedule.stage2_iterations = 2;
  return options;
}

}  // namespace duet::test
