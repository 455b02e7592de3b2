#include "duet/app/part.h"

#include <fmt/format.h>

namespace duet {

std::vector<Part>& parts() {
  static std::vector<Part> list;
  return list;
}

Instead added_by_part(const std::string& name, CLI::App& command) {
  if (const auto add = in_parts(&Part::extensions, name)) return add(command);
  return [](cli::Session&, const GivenWords&) { return false; };
}

std::string missing_part_message(const std::string& what, const std::string& part) {
  return fmt::format(
      "{} belongs to the part '{}', which this program was built without; `./run build` builds every part, CMake's "
      "option -DDUET_PARTS={} this one",
      what, part, part);
}

}  // namespace duet
