#include "duet/core/version.h"

namespace duet {

const char* duet_version() { return DUET_VERSION; }

}  // namespace duet
