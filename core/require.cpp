#include "duet/core/require.h"

namespace duet {

void throw_invalid(fmt::string_view format, fmt::format_args arguments) {
  throw std::invalid_argument(fmt::vformat(format, arguments));
}

}  // namespace duet
