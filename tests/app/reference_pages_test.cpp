#include "duet/app/reference_pages.h"

#include <gmock/gmock.h>

#include <algorithm>

#include "duet/backends/engine_module.h"
#include "duet/core/file.h"
#include "duet/parts/training/part.h"
#include "tests/support.h"

namespace duet {
namespace {

// A page of the engines is whole where the modules of all of them load.
bool can_be_made(const std::string& name) {
  const std::vector<EngineInfo> all = engines();
  return name != "engine-options" || std::ranges::all_of(all, &EngineInfo::module);
}

TEST(ReferencePages, TheFilesAreWhatTheTablesSay) {
  parts() = {training_part()};  // whose page there is beside those of the core
  EXPECT_EQ(reference_page_names().size(), 10U);
  for (const std::string& name : reference_page_names()) {
    if (!can_be_made(name)) continue;
    EXPECT_EQ(read_file(std::string(DUET_SOURCE_DIR) + "/docs/reference/" + name + ".md"), reference_page(name))
        << "`./run reference` writes docs/reference/" << name << ".md anew";
  }
}

TEST(ReferencePages, AnUnknownOneIsRefusedWithTheNearest) {
  EXPECT_THAT(test::thrown_message<std::invalid_argument>([] { reference_page("suite-key"); }),
              testing::HasSubstr("did you mean 'suite-keys'"));
}

}  // namespace
}  // namespace duet
