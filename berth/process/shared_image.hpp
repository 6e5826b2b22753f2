/// An image in memory that two processes share: one runs the device, the other the application, in C++ by this header,
/// in other languages by process.h.
///
///     auto image = process::SharedImage::create("belt", layout);      // the device's process
///     if (!image) return fail(image.error());
///     process::DeviceImage link(device, executor, (*image)->network(), bound, {.cycle = 5ms});
///
///     auto image = process::SharedApplication::open("belt");           // the application's
///     const auto level = (*image)->layout().handle<std::int16_t, process::Direction::output>("Silo level");
///
/// The file is /dev/shm/berth-NAME (shm_overview(7)), only for the user who made it. Each side holds a lock on it,
/// which the system removes when the process ends, however it ends. So there is only one of each side, and each can
/// check whether the other is there.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <tl/expected.hpp>

#include "berth/process/image.hpp"

namespace berth::process {

/// A file of shared memory, mapped.
class SharedMemory {
 public:
  enum class Side : std::uint8_t { network, application };
  /// A new file of that size, all 0; a file left by a dead process is replaced. Refused: a process uses it, or `name`
  /// has characters other than A to Z, a to z, 0 to 9, "-", "_" and ".".
  [[nodiscard]] static tl::expected<SharedMemory, std::string> create(std::string_view name, std::size_t size);
  /// The file that another process has created and uses.
  [[nodiscard]] static tl::expected<SharedMemory, std::string> open(std::string_view name);
  SharedMemory(SharedMemory&& other) noexcept;
  SharedMemory& operator=(SharedMemory&&) = delete;
  ~SharedMemory();

  [[nodiscard]] std::span<std::uint8_t> bytes() const noexcept { return bytes_; }
  /// True if the other side's process is there.
  [[nodiscard]] bool other() const noexcept;

 private:
  SharedMemory(std::string path, Side side) : path_(std::move(path)), side_(side) {}
  [[nodiscard]] bool map(std::size_t size) noexcept;
  std::string path_;
  Side side_;
  int file_ = -1;
  std::span<std::uint8_t> bytes_;
};

class SharedImage {
 public:
  /// Later changes of `layout` have no effect. The error says what is wrong and what to do.
  [[nodiscard]] static tl::expected<std::unique_ptr<SharedImage>, std::string> create(std::string_view name,
                                                                                      const Layout& layout);
  [[nodiscard]] NetworkSide& network() noexcept { return network_; }
  [[nodiscard]] bool application() const noexcept { return memory_.other(); }

 private:
  SharedImage(SharedMemory memory, const Layout& layout, const ImageFormat& format);
  SharedMemory memory_;
  Layout layout_;
  NetworkSide network_;
};

class SharedApplication {
 public:
  [[nodiscard]] static tl::expected<std::unique_ptr<SharedApplication>, std::string> open(std::string_view name);
  [[nodiscard]] const Layout& layout() const noexcept { return layout_; }
  [[nodiscard]] ApplicationSide& side() noexcept { return side_; }
  [[nodiscard]] const ApplicationSide& side() const noexcept { return side_; }
  /// True if the device's process is there and uses this image.
  [[nodiscard]] bool connected() const noexcept { return memory_.other(); }
  /// Age of an output's last reception, by the clock of this computer; empty while it is `BERTH_WAITING`.
  [[nodiscard]] std::optional<rt::Duration> age_now(std::uint32_t output) const noexcept;

 private:
  SharedApplication(SharedMemory memory, Layout layout);
  SharedMemory memory_;
  Layout layout_;
  ApplicationSide side_;
};

}  // namespace berth::process
