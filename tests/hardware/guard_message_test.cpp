#include "duet/hardware/guard/guard_message.h"

#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include "duet/core/numbers.h"
#include "duet/hardware/wire/datagram_socket.h"
#include "tests/support.h"

namespace duet {
namespace {

std::span<const std::byte> first(const GuardBuffer& buffer, std::size_t size) {
  return std::span<const std::byte>(buffer).first(size);
}

PlannerMessage planned() {
  PlannerMessage message{.sequence = 12345678901234, .command = {}, .acting = true};
  message.command.stamp = 7.25;
  message.command.root = {0.1, -0.05, 0.2, 0.74};
  message.command.q = Eigen::VectorXd::LinSpaced(kG1Motors, -1.0, 1.0);
  return message;
}

TEST(GuardMessage, APlannersCommandIsReadAsItWasSent) {
  GuardBuffer buffer;
  const std::size_t size = encode(planned(), buffer);
  GuardMessage read;
  ASSERT_EQ(decode(first(buffer, size), read), GuardMessageKind::kPlanner);
  EXPECT_EQ(read.planner.sequence, planned().sequence);
  EXPECT_EQ(read.planner.command.stamp, 7.25);
  EXPECT_EQ(read.planner.command.root.yaw_rate, 0.2);
  EXPECT_EQ(read.planner.command.q, planned().command.q);
  EXPECT_TRUE(read.planner.acting);
}

TEST(GuardMessage, APersonIsReadAsItWasSent) {
  PersonMessage person{.sequence = 9, .latency = 0.08};
  for (int j = 0; j < 24; ++j) person.joints.col(j) = Eigen::Vector3d(j, -j, 0.5 * j);
  GuardBuffer buffer;
  const std::size_t size = encode(person, buffer);
  GuardMessage read;
  ASSERT_EQ(decode(first(buffer, size), read), GuardMessageKind::kPerson);
  EXPECT_EQ(read.person.joints, person.joints);
  EXPECT_EQ(read.person.sequence, 9u);
  EXPECT_EQ(read.person.latency, 0.08);
}

TEST(GuardMessage, AStopIsAStop) {
  GuardBuffer buffer;
  GuardMessage read;
  EXPECT_EQ(decode(first(buffer, encode_stop(buffer)), read), GuardMessageKind::kStop);
}

TEST(GuardMessage, OtherLengthsVersionsAndKindsAreRefused) {
  GuardBuffer buffer;
  const std::size_t size = encode(planned(), buffer);
  GuardMessage read;
  for (std::size_t length = 0; length < size; ++length)
    EXPECT_EQ(decode(first(buffer, length), read), GuardMessageKind::kRefused) << length;
  EXPECT_EQ(decode(first(buffer, size + 1), read), GuardMessageKind::kRefused);
  buffer[0] ^= std::byte{1};
  EXPECT_EQ(decode(first(buffer, size), read), GuardMessageKind::kRefused);
  buffer[0] ^= std::byte{1};
  for (const int kind : {0, 2, 3, 4, 255}) {
    buffer[4] = static_cast<std::byte>(kind);
    EXPECT_EQ(decode(first(buffer, size), read), GuardMessageKind::kRefused) << kind;
  }
}

TEST(GuardMessage, RandomBytesBreakNothing) {
  Random random(19, 10);
  GuardMessage read;
  for (int k = 0; k < 20000; ++k) {
    GuardBuffer buffer;
    std::size_t size = encode(planned(), buffer);
    for (int change = 0; change < 4; ++change) buffer[random.below(300)] = static_cast<std::byte>(random.below(256));
    if (random.chance(0.2)) size = static_cast<std::size_t>(random.below(static_cast<int>(kMostGuardBytes)));
    const GuardMessageKind kind = decode(first(buffer, size), read);
    EXPECT_NE(kind, GuardMessageKind::kPerson);
  }
}

TEST(DatagramSocket, CarriesDatagramsAtAPathOfItsOwners) {
  const test::ScratchFolder folder;
  DatagramSocket here = DatagramSocket::at_path(folder / "guard");
  EXPECT_EQ(std::filesystem::status(folder / "guard").permissions() & std::filesystem::perms::all,
            std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
  DatagramSocket there = DatagramSocket::to_path(folder / "guard");
  GuardBuffer buffer;
  EXPECT_EQ(here.receive(buffer), 0u);
  EXPECT_TRUE(there.send(first(buffer, encode_stop(buffer))));
  EXPECT_EQ(here.receive(buffer), 16u);
}

TEST(DatagramSocket, SaysWhoIsNotThereAndWhoIs) {
  const test::ScratchFolder folder;
  EXPECT_NE(test::thrown_message<std::runtime_error>([&] {
              DatagramSocket::to_path(folder / "guard");
            }).find("nobody receives at"),
            std::string::npos);
  DatagramSocket here = DatagramSocket::at_path(folder / "guard");
  EXPECT_NE(test::thrown_message<std::runtime_error>([&] {
              DatagramSocket::at_path(folder / "guard");
            }).find("another process receives there"),
            std::string::npos);
  EXPECT_NE(test::thrown_message<std::runtime_error>([&] {
              DatagramSocket::at_path(std::string(200, 'x'));
            }).find("found 200"),
            std::string::npos);
}

TEST(DatagramSocket, CarriesDatagramsOverLoopback) {
  DatagramSocket here = DatagramSocket::at_port(0);
  DatagramSocket there = DatagramSocket::to_port(here.port());
  GuardBuffer buffer;
  EXPECT_FALSE(here.wait(0.001));
  EXPECT_TRUE(there.send(first(buffer, encode(planned(), buffer))));
  EXPECT_TRUE(here.wait(1.0));
  EXPECT_GT(here.receive(buffer), 16u);
  EXPECT_FALSE(here.wait(0.0));
}

}  // namespace
}  // namespace duet
