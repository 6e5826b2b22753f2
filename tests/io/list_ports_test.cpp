// What is plugged in, by a folder that looks like sysfs.
#include "berth/io/list_ports.hpp"

#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "tests/pch.hpp"

namespace berth::io {
namespace {

namespace fs = std::filesystem;

class ListPorts : public ::testing::Test {
 protected:
  ListPorts() {
    std::string pattern = (fs::temp_directory_path() / "berth-sys-XXXXXX").string();
    root_ = ::mkdtemp(pattern.data());
  }
  ~ListPorts() override { fs::remove_all(root_); }
  void write(const std::string& path, const std::string& text) const {
    fs::create_directories((root_ / path).parent_path());
    std::ofstream(root_ / path) << text;
  }
  // As the kernel has it: a link to the interface of the USB device, whose attributes stand in the folder above.
  void usb(const std::string& device, const std::string& link) const {
    fs::create_directories(root_ / device / "1-2:1.0");
    fs::create_directories((root_ / link).parent_path());
    fs::create_directory_symlink(root_ / device / "1-2:1.0", root_ / link);
  }
  fs::path root_;
};

TEST_F(ListPorts, InterfacesAndAdaptersWithTheirIdentity) {
  write("class/net/eth0/type", "1\n");
  write("class/net/can0/type", "280\n");
  write("class/net/can0/operstate", "down\n");
  write("class/net/vcan0/type", "280\n");
  write("class/net/vcan0/operstate", "unknown\n");
  usb("devices/usb1/1-1", "class/net/can0/device");
  write("devices/usb1/1-1/idVendor", "1d50\n");
  write("devices/usb1/1-1/idProduct", "606f\n");
  write("devices/usb1/1-1/product", "candleLight USB to CAN adapter\n");
  write("class/tty/tty0/dev", "4:0\n");
  write("class/tty/ttyS0/device/id", "x\n");
  usb("devices/usb1/1-2", "class/tty/ttyACM0/device");
  write("devices/usb1/1-2/idVendor", "16d0\n");
  write("devices/usb1/1-2/idProduct", "117e\n");
  write("devices/usb1/1-2/manufacturer", "CANable \"x\" ⚡\n");
  write("devices/usb1/1-2/serial", "0031\n");
  const auto ports = list_ports(root_);
  ASSERT_EQ(ports.size(), 3U) << "no Ethernet, no console, no serial port of the board";
  EXPECT_EQ(can::to_string(ports[0].port), "socketcan:can0");
  EXPECT_EQ(ports[0].state, "down");
  EXPECT_EQ(ports[0].usb, (UsbIdentity{"1d50", "606f", "", "candleLight USB to CAN adapter", ""}));
  EXPECT_EQ(can::to_string(ports[1].port), "socketcan:vcan0");
  EXPECT_FALSE(ports[1].usb);
  EXPECT_EQ(can::to_string(ports[2].port), "slcan:/dev/ttyACM0");
  EXPECT_EQ(ports[2].usb, (UsbIdentity{"16d0", "117e", "CANable \"x\" ⚡", "", "0031"}));
}

TEST_F(ListPorts, NothingAndOddThings) {
  EXPECT_TRUE(list_ports(root_).empty());
  EXPECT_TRUE(list_ports("/no such folder").empty());
  write("class/net/can0/type", std::string(100'000, '2'));
  fs::create_directories(root_ / "class/tty");
  fs::create_symlink("loop", root_ / "class/tty/loop");
  fs::create_directories(root_ / "class/tty/ttyUSB0");
  fs::create_symlink("nowhere", root_ / "class/tty/ttyUSB0/device");
  EXPECT_TRUE(list_ports(root_).empty());
}

}  // namespace
}  // namespace berth::io
