#include "followed.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>

#include "berth/command/control.hpp"
#include "options.hpp"

namespace berth::cli {

/// The port of one followed bus.
class FollowedBuses::Port final : public can::Port {
 public:
  Port(const FollowedBuses& all, std::uint32_t bit_rate) : all_(&all), bit_rate_(bit_rate) {}

  can::Queued send(const can::Frame&, std::uint32_t) noexcept override { return can::Queued::listen_only; }
  void withdraw(std::uint32_t) noexcept override {}
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept override {
    listener_ = listener;
    accept_.assign(accept.begin(), accept.end());
  }
  [[nodiscard]] can::Status status() const noexcept override {
    can::Status status;
    status.bit_rate = bit_rate_;
    status.listen_only = true;
    status.up = !all_->over();
    return status;
  }
  bool restart(std::uint32_t) noexcept override { return false; }

  void take(const can::Frame& frame, rt::Time at) noexcept {
    const auto passes = [&](const can::IdRange& range) { return range.contains(frame.key()); };
    if (listener_ != nullptr && std::ranges::any_of(accept_, passes)) listener_->received(frame, at);
  }

 private:
  const FollowedBuses* all_;
  std::uint32_t bit_rate_;
  can::Listener* listener_ = nullptr;
  std::vector<can::IdRange> accept_;
};

tl::expected<std::unique_ptr<FollowedBuses>, Failure> FollowedBuses::join(io::Loop& loop, const std::string& path,
                                                                          const design::Machine& machine) {
  const auto fd = command::control_follow(path);
  if (!fd) return tl::unexpected(failure(Exit::failed, fd.error()));
  return std::unique_ptr<FollowedBuses>(new FollowedBuses(*fd, path, loop, machine));
}

FollowedBuses::FollowedBuses(int fd, const std::string& path, io::Loop& loop, const design::Machine& machine)
    : fd_(fd), loop_(&loop), reader_(path) {
  for (const auto& bus : machine.buses) ports_[bus.name] = std::make_unique<Port>(*this, bus.bitrate);
  loop_->watch(fd_, *this, EPOLLIN);
}

FollowedBuses::~FollowedBuses() { close(); }

can::Port& FollowedBuses::port(const std::string& bus) { return *ports_.at(bus); }

void FollowedBuses::close() noexcept {
  if (fd_ < 0) return;
  loop_->forget(fd_);
  ::close(fd_);
  fd_ = -1;
}

void FollowedBuses::ready(std::uint32_t) noexcept {
  std::array<char, 65536> buffer;
  const auto got = ::read(fd_, buffer.data(), buffer.size());
  if (got < 0 && (errno == EINTR || errno == EAGAIN)) return;
  if (got <= 0) return close();
  feed({buffer.data(), static_cast<std::size_t>(got)});
}

void FollowedBuses::feed(std::string_view bytes) {
  rest_ += bytes;
  std::size_t from = 0;
  for (auto end = rest_.find('\n'); end != std::string::npos; end = rest_.find('\n', from)) {
    const std::string_view line = std::string_view(rest_).substr(from, end + 1 - from);
    constexpr std::string_view dropped = "dropped ";
    if (line.starts_with(dropped)) {
      std::uint64_t count = 0;
      std::from_chars(line.data() + dropped.size(), line.data() + line.size(), count);
      dropped_ += count;
    } else {
      reader_.feed(line, *this);
    }
    from = end + 1;
  }
  rest_.erase(0, from);
}

// The other process's clock runs as fast as this one's, but has another zero.
void FollowedBuses::entry(const trace::Entry& entry) {
  const auto& buses = reader_.buses();
  if (entry.bus >= buses.size()) return;
  const auto port = ports_.find(buses[entry.bus]);
  if (port == ports_.end()) return;
  const rt::Time now = loop_->executor().now();
  if (!offset_) offset_ = now.time_since_epoch() - entry.at;
  port->second->take(entry.frame, std::min(now, rt::Time(entry.at + *offset_)));
}

void FollowedBuses::finding(Finding) {}

}  // namespace berth::cli
