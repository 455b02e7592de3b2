// A digest that tells whether two motions come from one clip, whatever they were called: for data splits.
#pragma once

#include <string>

#include "duet/motion/paired_motion.h"

namespace duet {

// SHA-256 over task, phases and both people's joints as they were before retargeting, to a tenth of a millimetre.
std::string clip_digest(const PairedMotion& motion);

}  // namespace duet
