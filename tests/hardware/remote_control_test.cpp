#include <gtest/gtest.h>

#include <array>

#include "duet/hardware/wire/low_level_frame.h"

namespace duet {
namespace {

using Bytes = std::array<std::uint8_t, kRemoteBytes>;

TEST(RemoteControl, KeysAndSticksStandAtTheirPlaces) {
  Bytes bytes{};
  bytes[0] = 0x55;
  bytes[2] = 0x10;  // bit 4: R2
  bytes[3] = 0x01;  // bit 8: A
  bytes[23] = 0x3F;
  bytes[22] = 0x80;  // ly = 1
  const RemoteControl remote = read_remote(bytes);
  EXPECT_TRUE(remote.heard);
  EXPECT_TRUE(remote.holds(RemoteKey::kR2));
  EXPECT_TRUE(remote.holds(RemoteKey::kA));
  EXPECT_FALSE(remote.holds(RemoteKey::kB));
  EXPECT_EQ(remote.ly, 1.0f);
  EXPECT_EQ(remote.lx, 0.0f);
}

TEST(RemoteControl, ZerosAloneMeanThatItIsLost) {
  EXPECT_FALSE(read_remote(Bytes{}).heard);
  Bytes bytes{};
  bytes[39] = 1;
  EXPECT_TRUE(read_remote(bytes).heard);
}

TEST(RemoteControl, WhatIsWrittenIsRead) {
  const RemoteControl sent{.keys = 0x8421, .lx = -0.5f, .ly = 0.25f, .rx = 1.0f, .ry = -1.0f, .heard = true};
  Bytes bytes;
  bytes.fill(0xFF);
  write_remote(sent, bytes);
  const RemoteControl read = read_remote(bytes);
  EXPECT_EQ(read.keys, sent.keys);
  EXPECT_EQ(read.lx, sent.lx);
  EXPECT_EQ(read.ly, sent.ly);
  EXPECT_EQ(read.rx, sent.rx);
  EXPECT_EQ(read.ry, sent.ry);
  write_remote({}, bytes);
  EXPECT_FALSE(read_remote(bytes).heard);
}

TEST(RemoteControl, SelectStopsAndSoDoL2WithB) {
  const auto stops = [](std::initializer_list<RemoteKey> keys) {
    RemoteControl remote;
    for (const RemoteKey key : keys) remote.keys |= static_cast<std::uint16_t>(1u << static_cast<int>(key));
    return remote.asks_to_stop();
  };
  EXPECT_TRUE(stops({RemoteKey::kSelect}));
  EXPECT_TRUE(stops({RemoteKey::kL2, RemoteKey::kB}));
  EXPECT_FALSE(stops({RemoteKey::kL2}));
  EXPECT_FALSE(stops({RemoteKey::kB}));
  EXPECT_FALSE(stops({RemoteKey::kStart, RemoteKey::kA, RemoteKey::kR2}));
}

}  // namespace
}  // namespace duet
