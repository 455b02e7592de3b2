#include <gtest/gtest.h>

#include "duet/core/machine.h"

namespace duet {
namespace {

constexpr InstructionSet kAll[] = {InstructionSet::kPortable, InstructionSet::kV2, InstructionSet::kV3,
                                   InstructionSet::kV4};

TEST(InstructionSet, WhoeverHasOneHasTheNarrowerOnes) {
  EXPECT_TRUE(runs_here(InstructionSet::kPortable));
  for (std::size_t i = 1; i < std::size(kAll); ++i)
    EXPECT_TRUE(!runs_here(kAll[i]) || runs_here(kAll[i - 1])) << to_string(kAll[i]);
}

TEST(InstructionSet, OnlyX86HasThoseOfX86) {
#if defined(__x86_64__)
  EXPECT_TRUE(runs_here(InstructionSet::kV2));
#else
  for (const InstructionSet set : {InstructionSet::kV2, InstructionSet::kV3, InstructionSet::kV4})
    EXPECT_FALSE(runs_here(set)) << to_string(set);
#endif
}

TEST(InstructionSet, NamesAreThoseOfTheCompilers) {
  EXPECT_EQ(to_string(InstructionSet::kPortable), "portable");
  EXPECT_EQ(to_string(InstructionSet::kV4), "x86-64-v4");
}

}  // namespace
}  // namespace duet
