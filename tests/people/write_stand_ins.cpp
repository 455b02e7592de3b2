// Writes the stand-ins of the formats of people (examples/data/people): to be run where a layout changes.
#include "duet/core/file.h"
#include "tests/people/format_cases.h"

int main() {
  using namespace duet;
  for (const test::FormatCase& which : test::format_cases()) {
    const auto [a, b] = test::stand_in_people(which);
    for (const auto& [name, bytes] : which.files(a, b)) write_file(test::stand_in_folder(which) + "/" + name, bytes);
  }
}
