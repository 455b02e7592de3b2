#include "duet/hardware/wire/lcm_message.h"

#include <gtest/gtest.h>

#include <cstring>
#include <vector>

#include "duet/core/numbers.h"
#include "tests/support.h"

namespace duet {
namespace {

// Hashes that liblcm's own generator prints for HOMIE's types.
TEST(LcmMessage, HashesAreThoseOfTheFields) {
  const LcmField pedal[] = {{"command", "double", 4}};
  const LcmField arms[] = {{"act", "double", 14}};
  const LcmField targets[] = {{"q_des", "double", 29}, {"tau_ff", "double", 29}, {"timestamp_us", "int64_t"}};
  const LcmField body[] = {{"q", "float", 29}, {"qd", "float", 29}, {"timestamp_us", "int64_t"}};
  EXPECT_EQ(lcm_hash(pedal), 0x507A292EA92A57D0u);
  EXPECT_EQ(lcm_hash(arms), 0x692F2BE95563F8FEu);
  EXPECT_EQ(lcm_hash(targets), 0xC36D9A4A18CA6110u);
  EXPECT_EQ(lcm_hash(body), 0xFA781C9A388DFC5Au);
}

TEST(LcmMessage, APedalCommandHasTheGoldenBytes) {
  LcmBuffer buffer;
  const PedalCommand command{{0.2, -0.1, 0.0, 0.74}};
  const std::size_t size = encode(command, 0x01020304, buffer);
  ASSERT_EQ(size, 8u + 14u + 8u + 32u);
  const unsigned char head[] = {'L', 'C', '0', '2', 1,   2, 3,    4,    'p',  'e',  'd',  'a',  'l',  '_',  'c',  'o',
                                'm', 'm', 'a', 'n', 'd', 0, 0xA0, 0xF4, 0x52, 0x5D, 0x52, 0x54, 0xAF, 0xA0, 0x3F, 0xC9};
  EXPECT_EQ(std::memcmp(buffer.data(), head, sizeof(head)), 0);
}

template <typename Message>
std::vector<std::byte> sent(const Message& message, std::uint32_t sequence = 9) {
  LcmBuffer buffer;
  const std::size_t size = encode(message, sequence, buffer);
  return {buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(size)};
}

TEST(LcmMessage, WhatIsSentIsReceived) {
  PdTargets targets;
  BodyControlData body;
  for (int j = 0; j < kLcmJoints; ++j) {
    targets.q_des[j] = 0.1 * j;
    targets.tau_ff[j] = -j;
    body.q[j] = 0.5f * j;
    body.qd[j] = -0.25f * j;
  }
  targets.timestamp_us = -123456789012345;
  PdTargets read_targets;
  EXPECT_EQ(decode(sent(targets, 77), read_targets).sequence, 77u);
  EXPECT_EQ(read_targets.q_des, targets.q_des);
  EXPECT_EQ(read_targets.tau_ff, targets.tau_ff);
  EXPECT_EQ(read_targets.timestamp_us, targets.timestamp_us);
  BodyControlData read_body;
  EXPECT_EQ(decode(sent(body), read_body).refusal, "");
  EXPECT_EQ(read_body.qd, body.qd);
  ArmAction arms, read_arms;
  for (int j = 0; j < kLcmArmJoints; ++j) arms.act[j] = j;
  EXPECT_EQ(decode(sent(arms), read_arms).refusal, "");
  EXPECT_EQ(read_arms.act, arms.act);
}

std::string refusal(std::vector<std::byte> datagram) {
  PedalCommand message{{9.0, 9.0, 9.0, 9.0}};
  const LcmReading reading = decode(datagram, message);
  EXPECT_EQ(message.command[0], 9.0);  // untouched
  return std::string(reading.refusal);
}

TEST(LcmMessage, RefusesWhatIsNotSuchAMessage) {
  const std::vector<std::byte> good = sent(PedalCommand{});
  EXPECT_SENTENCE(refusal({}));
  std::vector<std::byte> bad = good;
  bad[3] = std::byte{'3'};
  EXPECT_SENTENCE(refusal(bad));
  EXPECT_SENTENCE(refusal(sent(ArmAction{})));
  bad = good;
  bad[22] ^= std::byte{1};
  EXPECT_SENTENCE(refusal(bad));
  bad = good;
  bad.pop_back();
  EXPECT_SENTENCE(refusal(bad));
  bad = good;
  bad.push_back(std::byte{0});
  EXPECT_SENTENCE(refusal(bad));
}

// Arms and hands have one fingerprint: the channel alone keeps them apart.
TEST(LcmMessage, AHandActionIsNoArmAction) {
  std::vector<std::byte> hand = sent(ArmAction{});
  std::memcpy(hand.data() + 8, "han_action", 10);
  ArmAction message;
  EXPECT_SENTENCE(std::string(decode(hand, message).refusal));
}

TEST(LcmMessage, EveryShorterDatagramIsRefused) {
  const std::vector<std::byte> good = sent(PedalCommand{});
  for (std::size_t length = 0; length < good.size(); ++length)
    EXPECT_NE(refusal({good.begin(), good.begin() + static_cast<std::ptrdiff_t>(length)}), "") << length;
}

}  // namespace
}  // namespace duet
