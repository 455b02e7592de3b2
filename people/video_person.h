// One person whom an estimator followed through a video, as the camera has them: the joints that would have been sent
// to a robot. Files of 4D-Humans with PHALP (.pkl, the camera's frame) and of GVHMR (hmr4d_results.pt, its
// `smpl_params_incam`). Their body models are licensed: the user names a file, else an average person's bones stand in.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "duet/core/recording.h"

namespace duet {

struct VideoPersonOptions {
  std::string body_model = {};         // path of the user's SMPL, SMPL-H or SMPL-X file
  std::optional<double> rate_hz = {};  // of the video; none: 30, as most
  double depth_scale = 1.0;            // of the pelvis: the camera's focal length by the one that the estimator took
};

struct VideoPerson {
  std::string format;  // "4d-humans", "gvhmr"
  double rate_hz = 30.0;
  PointTracks joints;      // (T, 24) in the camera's frame: x right, y down, z ahead [m]; zero where nobody is seen
  std::vector<bool> seen;  // T
  std::string evidence;    // one sentence: what was taken of the file
};

// The person who is in the picture for longest; of several the nearest. Throws InputError naming file, place, expected
// and found.
VideoPerson read_video_person(const std::string& path, const VideoPersonOptions& options = {});
// Whether it is such a file, by its name and first bytes.
bool is_video_person(const std::string& path);

// Parts of it, by format (people/formats).
VideoPerson read_phalp_person(const std::string& path, const VideoPersonOptions& options);
VideoPerson read_gvhmr_person(const std::string& path, const VideoPersonOptions& options);
bool is_torch_person(const std::string& path);

}  // namespace duet
