#include <gtest/gtest.h>

#include "berth/can/port_spec.hpp"

namespace berth::can {
namespace {

TEST(Port, EveryKind) {
  for (const char* text :
       {"sim", "plant:/run/p.sock", "socketcan:can0", "slcan:/dev/ttyACM0", "socketcand://host:29536/can0"}) {
    const auto port = parse_port(text);
    ASSERT_TRUE(port) << text;
    EXPECT_EQ(to_string(*port), text);
  }
  for (const char* text :
       {"", "can0", "socketcan:", "slcan:", "plant:", "socketcand://host", "socketcand:///can0", "sim:x"}) {
    EXPECT_FALSE(parse_port(text)) << text;
  }
}

}  // namespace
}  // namespace berth::can
