#include "duet/hardware/wire/lcm_message.h"

#include <dlfcn.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <fstream>
#include <memory>
#include <sstream>
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

// Our LCM against liblcm itself, where it is installed (Debian's liblcm1): it is opened at run time, nothing is linked.
// It takes the interface of the route to the group, so that is where ours goes too.

// As in lcm/lcm.h.
struct LcmReceived {
  void* data;
  std::uint32_t size;
};
using LcmHandler = void (*)(const LcmReceived*, const char*, void*);

struct Liblcm {
  Liblcm() : library(dlopen("liblcm.so.1", RTLD_NOW)) {
    if (library == nullptr) return;
    find("lcm_create", create);
    find("lcm_destroy", destroy);
    find("lcm_publish", publish);
    find("lcm_subscribe", subscribe);
    find("lcm_handle_timeout", handle);
  }
  template <typename Function>
  void find(const char* name, Function& function) {
    function = reinterpret_cast<Function>(dlsym(library, name));
  }

  void* library;
  void* (*create)(const char*) = nullptr;
  void (*destroy)(void*) = nullptr;
  int (*publish)(void*, const char*, const void*, unsigned) = nullptr;
  void* (*subscribe)(void*, const char*, LcmHandler, void*) = nullptr;
  int (*handle)(void*, int) = nullptr;
};

// The interface of the default route; empty where there is none.
std::string routed_interface() {
  std::ifstream routes("/proc/net/route");
  std::string line, name, destination;
  std::getline(routes, line);
  while (std::getline(routes, line)) {
    std::istringstream(line) >> name >> destination;
    if (destination == "00000000") return name;
  }
  return "";
}

std::unique_ptr<LcmChannel> joined(const LcmPlace& place) {
  try {
    return std::make_unique<LcmChannel>(place);
  } catch (const std::runtime_error&) {
    return nullptr;
  }
}

// The payload of a datagram of ours, behind "LC02", number and channel.
std::string payload(std::span<const std::byte> datagram) {
  const std::string all(reinterpret_cast<const char*>(datagram.data()), datagram.size());
  return all.substr(all.find('\0', 8) + 1);
}

TEST(Liblcm, TakesOurMessagesAndItsAreTakenByUs) {
  const Liblcm lcm;
  if (lcm.handle == nullptr) GTEST_SKIP() << "not run: liblcm absent";
  LcmPlace place;
  place.interface = routed_interface();
  place.port = 20000 + static_cast<int>(getpid()) % 20000;
  const std::unique_ptr<LcmChannel> channel = place.interface.empty() ? nullptr : joined(place);
  if (channel == nullptr) GTEST_SKIP() << "not run: no interface that multicast is routed to";
  const std::string url = "udpm://" + place.group + ":" + std::to_string(place.port) + "?ttl=0";
  const std::unique_ptr<void, void (*)(void*)> peer(lcm.create(url.c_str()), lcm.destroy);
  if (peer == nullptr) GTEST_SKIP() << "not run: liblcm cannot join the group";
  LcmBuffer buffer;
  const std::size_t size = encode(PedalCommand{{0.2, -0.1, 0.3, 0.74}}, 7, buffer);
  const std::string sent = payload(std::span<const std::byte>(buffer).first(size));

  std::string heard;
  const LcmHandler keep = [](const LcmReceived* received, const char*, void* into) {
    *static_cast<std::string*>(into) = std::string(static_cast<const char*>(received->data), received->size);
  };
  lcm.subscribe(peer.get(), "pedal_command", keep, &heard);
  ASSERT_TRUE(channel->send(std::span<const std::byte>(buffer).first(size)));
  ASSERT_GT(lcm.handle(peer.get(), 2000), 0);
  EXPECT_EQ(heard, sent);

  ASSERT_EQ(lcm.publish(peer.get(), "pedal_command", sent.data(), static_cast<unsigned>(sent.size())), 0);
  PedalCommand taken;
  bool own = true;
  bool took = false;  // liblcm says something of its own to the group too, when it joins
  for (int k = 0; k < 200 && !took; ++k) {
    const std::size_t came = channel->receive(buffer, own);
    took = came > 0 && !own && decode(std::span<const std::byte>(buffer).first(came), taken).refusal.empty();
    if (came == 0) usleep(10000);
  }
  EXPECT_TRUE(took);
  EXPECT_EQ(taken.command[0], 0.2);
  EXPECT_EQ(taken.command[3], 0.74);
}

}  // namespace
}  // namespace duet
