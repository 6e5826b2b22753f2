/// An image in memory that two processes share: one has the device, the other is the application, in C++ by this
/// header, in other languages by process.h.
///
///     auto image = process::SharedImage::create("belt", layout);      // the device's process
///     if (!image) return fail(image.error());
///     process::DeviceImage link(device, executor, (*image)->network(), bound, {.cycle = 5ms});
///
///     auto image = process::SharedApplication::open("belt");           // the application's
///     const auto level = (*image)->layout().handle<std::int16_t, process::Direction::output>("Silo level");
///
/// The file is /dev/shm/berth-NAME (shm_overview(7)), for the user who made it alone. Each side holds a lock on it,
/// which the system takes away when the process ends, however it ends: there is one of each side, and each can ask
/// whether the other is there.
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
  /// A new file of that size, all 0; one that a process left behind is replaced. Refused: a process has it, letters in
  /// `name` other than A to Z, a to z, 0 to 9, "-", "_" and ".".
  [[nodiscard]] static tl::expected<SharedMemory, std::string> create(std::string_view name, std::size_t size);
  /// The one that a process has created and has.
  [[nodiscard]] static tl::expected<SharedMemory, std::string> open(std::string_view name);
  SharedMemory(SharedMemory&& other) noexcept;
  SharedMemory& operator=(SharedMemory&&) = delete;
  ~SharedMemory();

  [[nodiscard]] std::span<std::uint8_t> bytes() const noexcept { return bytes_; }
  /// The other side's process is there.
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
  /// Later changes of `layout` are not seen. The error says what is wrong and what to do.
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
  /// The device's process is there, and this is its image.
  [[nodiscard]] bool connected() const noexcept { return memory_.other(); }
  /// How long ago an output was received, by the clock of this computer; empty while it is `BERTH_WAITING`.
  [[nodiscard]] std::optional<rt::Duration> age_now(std::uint32_t output) const noexcept;

 private:
  SharedApplication(SharedMemory memory, Layout layout);
  SharedMemory memory_;
  Layout layout_;
  ApplicationSide side_;
};

}  // namespace berth::process
