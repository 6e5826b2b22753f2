// The frames of flying masters (CiA 302-2) in words.
#include <gtest/gtest.h>

#include <string>

#include "berth/decode/words.hpp"

using namespace berth;

TEST(FlyingWords, EachFrame) {
  decode::Interpreter interpreter;
  EXPECT_EQ(interpreter.words(can::Frame::base(0x71, {1, 127})),
            "flying master: node 127 is the active master, priority 1");
  EXPECT_EQ(interpreter.words(can::Frame::base(0x71, {1})), "flying master: a claim of the wrong length");
  EXPECT_EQ(interpreter.words(can::Frame::base(0x72, {})), "flying master: the negotiation begins");
  EXPECT_EQ(interpreter.words(can::Frame::base(0x73, {})), "flying master: which node is the active master?");
  EXPECT_EQ(interpreter.words(can::Frame::base(0x74, {})), "flying master: here is a device that can be master");
  EXPECT_EQ(interpreter.words(can::Frame::base(0x75, {})), "flying master: is there a device that can be master?");
  EXPECT_EQ(interpreter.words(can::Frame::base(0x76, {})), "flying master: the active master is to negotiate");
  std::string text;
  EXPECT_EQ(interpreter.words(can::Frame::base(0x71, {1, 127}), text).service, decode::Service::nmt);
}
