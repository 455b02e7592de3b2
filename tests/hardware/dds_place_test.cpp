
#include "duet/hardware/wire/robot_wire.h"
#include "tests/support.h"

namespace duet {
namespace {

std::string refusal(const DdsPlace& place) {
  return test::thrown_message<std::invalid_argument>([&] { check_place(place); });
}

TEST(DdsPlace, NeedsANamedInterface) {
  EXPECT_NO_THROW(check_place({0, "eth1"}));
  for (const char* interface : {"", "auto", "a\"/><x", "eth0 eth1", "averyveryverylongname"})
    EXPECT_SENTENCE(refusal({0, interface}));
}

TEST(DdsPlace, NeedsADomain) {
  for (const int domain : {-1, 200, 1000}) EXPECT_SENTENCE(refusal({domain, "lo"}));
}

TEST(DdsPlace, ATwinsIsOnLoopbackInDomainsOfItsOwn) {
  EXPECT_NO_THROW(check_twin_place({100, "lo"}));
  EXPECT_NO_THROW(check_twin_place({199, "lo"}));
  EXPECT_NO_THROW(check_twin_place({1, "lo"}));  // unitree_mujoco's
  for (const DdsPlace& place :
       {DdsPlace{0, "lo"}, DdsPlace{2, "lo"}, DdsPlace{99, "lo"}, DdsPlace{150, "eth0"}, DdsPlace{1, "eth0"}})
    EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { check_twin_place(place); }));
}

}  // namespace
}  // namespace duet
