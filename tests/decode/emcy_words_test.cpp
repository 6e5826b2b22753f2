#include "berth/decode/emcy_words.hpp"

#include <gtest/gtest.h>

#include <string>

namespace berth::decode {
namespace {

// The same code is another thing in a drive (CiA 402) than in an I/O module (CiA 401); the rest is CiA 301's.
TEST(EmcyWords, AreThoseOfTheDevicesProfile) {
  EXPECT_EQ(std::string(emcy_words(0x3210, 402)), "DC link over-voltage");
  EXPECT_EQ(std::string(emcy_words(0x3210, 401)), "internal voltage too high");
  EXPECT_EQ(std::string(emcy_words(0x8611, 402)), "following error too great");
  EXPECT_EQ(std::string(emcy_words(0x7113, 402)), "protective circuit of the brake chopper");
  EXPECT_EQ(std::string(emcy_words(0x2331, 402)), "earth leakage, phase U");
  EXPECT_EQ(std::string(emcy_words(0x5010, 410)), "sensor of the X axis");
  EXPECT_EQ(std::string(emcy_words(0x5020, 410)), "sensor of the Y axis");
  EXPECT_EQ(std::string(emcy_words(0x5020, 406)), "device hardware") << "of an encoder it is CiA 301's class";
  EXPECT_EQ(std::string(emcy_words(0x2320, 401)), "short circuit at outputs");
  EXPECT_EQ(std::string(emcy_words(0xFF05, 417)), "car too fast");
  EXPECT_EQ(std::string(emcy_words(0xFF05, 402)), "device specific");
  EXPECT_EQ(std::string(emcy_words(0x8130, 402)), "life guard or heartbeat error") << "CiA 301's, whatever the profile";
  EXPECT_EQ(std::string(emcy_words(0x8611, 0)), std::string(emcy_words(0x8611, 404)));
}

}  // namespace
}  // namespace berth::decode
