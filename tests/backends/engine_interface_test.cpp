#include <gmock/gmock.h>

#include <cstdlib>

#include "duet/backends/engine_module.h"
#include "duet/core/require.h"
#include "duet/core/share.h"
#include "tests/backends/small_robots.h"
#include "tests/support.h"

namespace duet {
namespace {

using engine_layout::Digest;

struct Old {
  double mass = 0.0;
  int link = 0;
};
struct Reordered {
  int link = 0;
  double mass = 0.0;
};
struct Longer {
  double mass = 0.0;
  int link = 0;
  std::string region;
};
struct Narrower {
  float mass = 0.0F;
  int link = 0;
};

template <typename T>
std::uint64_t layout_of() {
  Digest digest;
  digest.add_type(&T::mass, &T::link);
  return digest.value();
}

TEST(EngineInterface, ChangesWithTheOrderSizeAndNumberOfMembers) {
  EXPECT_EQ(layout_of<Old>(), layout_of<Old>());
  for (const std::uint64_t other : {layout_of<Reordered>(), layout_of<Longer>(), layout_of<Narrower>()})
    EXPECT_NE(layout_of<Old>(), other);
}

struct Interface {
  virtual ~Interface() = default;
  virtual void first() = 0;
};
struct WithOneMore : Interface {
  virtual void second() = 0;
};
struct AfterInterface : Interface {
  virtual void after() = 0;
};
struct AfterOneMore : WithOneMore {
  virtual void after() = 0;
};

TEST(EngineInterface, ChangesWithTheNumberOfVirtualFunctions) {
  EXPECT_EQ(Digest::first_word(&AfterOneMore::after) - Digest::first_word(&AfterInterface::after), sizeof(void*));
}

TEST(EngineInterface, IsOneNumberInOneProgram) { EXPECT_EQ(engine_interface(), EngineModule().interface); }

// The modules of this test stand in folders of their own.
TEST(EngineFolders, AModuleThatWasCompiledAgainstOtherTypesIsRefusedByOneSentence) {
  setenv("DUET_ENGINES", DUET_STRANGE_ENGINES ":" DUET_BUILT_ENGINES, 1);
  Scene scene;
  scene.robot = test::sledge();
  const std::string message = test::thrown_message<MissingError>([&] { make_backend("stranger", scene); });
  EXPECT_THAT(message, ::testing::MatchesRegex(
                           "engine 'stranger' is absent: .*/duet_stranger\\.so was compiled against other types "
                           "\\(interface [0-9a-f]{16}, duet [0-9.]+ has [0-9a-f]{16}\\): compile it again with the "
                           "headers and the compiler flags of this duet"));
  int strangers = 0, shipped = 0;
  for (const EngineInfo& info : engines()) {
    strangers += info.name == "stranger";
    shipped += info.available;
    EXPECT_FALSE(info.available && info.name == "stranger");
  }
  EXPECT_EQ(strangers, 1);
  if (shipped == 0) GTEST_SKIP() << "not run: engines absent";
}

}  // namespace
}  // namespace duet
