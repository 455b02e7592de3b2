// The camera's place on the robot's body, from a person who stood at marked places: the rigid motion that brings the
// ankles as the camera had them to where the marks are (least squares, Umeyama 1991), and how well it is known. Pure
// functions.
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "duet/hardware/guard/person_track.h"

namespace duet {

// Where somebody stood.
struct MarkedPlace {
  Eigen::Vector3d p_BP;  // the middle between their ankles, in the base's frame: the mark, at an ankle's height [m]
  Eigen::Vector3d p_CP;  // the same as estimated: the mean [m]
  double moved = 0.0;    // of the estimates about that mean, standard deviation [m]
  int estimates = 0;
};

struct CameraCalibration {
  Pose X_BC;
  double rms = 0.0;                    // of the residuals [m]
  std::vector<double> residuals = {};  // of each place [m]
  Eigen::Vector3d position_error;      // standard errors along the base's axes [m]
  Eigen::Vector3d rotation_error;      // and about them [rad]
  double scale = 1.0;  // of the distances between marks to those between estimates: 1 for a camera whose
                       // focal length is the estimator's
};

// The places of `path` (docs/hardware.md, "Calibration"): YAML, with the person's log beside it. Throws InputError
// naming file, place, expected and found.
std::vector<MarkedPlace> read_marked_places(const std::string& path);

// Throws InputError naming `name` for fewer than 3 places, and for places within 0.3 m of one line.
CameraCalibration calibrate_camera(std::span<const MarkedPlace> places, const std::string& name);

}  // namespace duet
