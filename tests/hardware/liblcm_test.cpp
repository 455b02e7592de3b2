// Our LCM against liblcm itself, where it is installed (Debian's liblcm1): it is opened at run time, nothing is linked.
// It takes the interface of the route to the group, so that is where ours goes too.
#include <dlfcn.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <fstream>
#include <memory>
#include <sstream>

#include "duet/hardware/wire/lcm_message.h"

namespace duet {
namespace {

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
