#include "berth/io/socketcan_socket.hpp"

#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <linux/sock_diag.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <ctime>

namespace berth::io {
namespace {

// A second of a full bus: 18,000 short frames at 1 Mbit/s, each of which takes about 800 bytes in the kernel's count.
constexpr int receive_buffer = 8 << 20;
// All errors that this port understands. Losing arbitration is no error, and comes often.
constexpr can_err_mask_t errors_heard =
    CAN_ERR_CRTL | CAN_ERR_PROT | CAN_ERR_ACK | CAN_ERR_BUSOFF | CAN_ERR_BUSERROR | CAN_ERR_RESTARTED | CAN_ERR_CNT;

template <class T>
bool set(int fd, int level, int option, const T& value) noexcept {
  return ::setsockopt(fd, level, option, &value, sizeof value) == 0;
}

}  // namespace

bool CanSocket::open(int index) noexcept {
  close();
  fd_ = ::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, CAN_RAW);
  if (fd_ < 0) return false;
  prepare();
  const int on = 1;
  filter({});
  set(fd_, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, errors_heard);
  set(fd_, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, on);
  set(fd_, SOL_SOCKET, SO_TIMESTAMPNS, on);
  if (!set(fd_, SOL_SOCKET, SO_RCVBUFFORCE, receive_buffer)) set(fd_, SOL_SOCKET, SO_RCVBUF, receive_buffer);
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = index;
  const void* const plain = &address;
  if (::bind(fd_, static_cast<const sockaddr*>(plain), sizeof address) == 0) return true;
  const int why = errno;
  close();
  errno = why;
  return false;
}

// A port that hears its own frames must know which of them the receive buffer lost. Other ports ask for the sum when
// they need it, and save the counter that comes with each frame.
bool CanSocket::hear_own() noexcept {
  const int on = 1;
  set(fd_, SOL_SOCKET, SO_RXQ_OVFL, on);
  return set(fd_, SOL_CAN_RAW, CAN_RAW_RECV_OWN_MSGS, on);
}

void CanSocket::close() noexcept {
  if (fd_ >= 0) ::close(fd_);
  fd_ = -1;
  dropped_ = 0;
}

void CanSocket::prepare() {
  slots_.resize(batch);
  heads_.resize(batch);
  for (std::size_t i = 0; i < batch; ++i) {
    slots_[i].part = {slots_[i].frame.data(), slots_[i].frame.size()};
    msghdr& head = heads_[i].msg_hdr;
    head = {};
    head.msg_iov = &slots_[i].part;
    head.msg_iovlen = 1;
    head.msg_control = slots_[i].control.data();
  }
}

bool CanSocket::filter(std::span<const KernelFilter> filters) noexcept {
  static_assert(sizeof(KernelFilter) == sizeof(can_filter));
  return ::setsockopt(fd_, SOL_CAN_RAW, CAN_RAW_FILTER, filters.data(),
                      static_cast<socklen_t>(filters.size() * sizeof(can_filter))) == 0;
}

CanSocket::Wrote CanSocket::write(const KernelFrame& bytes, std::size_t size) noexcept {
  for (;;) {
    if (::write(fd_, bytes.data(), size) >= 0) return Wrote::yes;
    switch (errno) {
      case EINTR: continue;
      case ENOBUFS:
      case ENOMEM: return Wrote::full;
      case EAGAIN: return Wrote::waiting;
      case ENETDOWN:
      case ENODEV:
      case ENXIO: return Wrote::down;
      default: return Wrote::refused;
    }
  }
}

void CanSocket::take(const msghdr& head, Received& to) noexcept {
  to.own = (head.msg_flags & MSG_CONFIRM) != 0;
  to.stamp.reset();
  for (const cmsghdr* c = CMSG_FIRSTHDR(&head); c != nullptr;
       c = CMSG_NXTHDR(const_cast<msghdr*>(&head), const_cast<cmsghdr*>(c))) {
    if (c->cmsg_level != SOL_SOCKET) continue;
    if (c->cmsg_type == SCM_TIMESTAMPNS) {
      timespec time{};
      std::memcpy(&time, CMSG_DATA(c), sizeof time);
      to.stamp = std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
    } else if (c->cmsg_type == SO_RXQ_OVFL) {
      std::memcpy(&dropped_, CMSG_DATA(c), sizeof dropped_);
    }
  }
}

// The same as recvmmsg of one message, and cheaper.
int CanSocket::read_one() noexcept {
  const auto n = ::recvmsg(fd_, &heads_[0].msg_hdr, MSG_DONTWAIT);
  if (n < 0) return -1;
  heads_[0].msg_len = static_cast<unsigned>(n);
  return 1;
}

std::span<const CanSocket::Received> CanSocket::read(std::size_t most, int& error) noexcept {
  most = std::min(most, batch);
  for (std::size_t i = 0; i < most; ++i) heads_[i].msg_hdr.msg_controllen = slots_[i].control.size();
  int count = -1;
  do {
    count = most == 1 ? read_one() : ::recvmmsg(fd_, heads_.data(), static_cast<unsigned>(most), MSG_DONTWAIT, nullptr);
  } while (count < 0 && errno == EINTR);
  error = count >= 0 || errno == EAGAIN ? 0 : errno;
  std::size_t good = 0;
  for (int i = 0; i < count; ++i) {
    const auto at = static_cast<std::size_t>(i);
    take(heads_[at].msg_hdr, received_[good]);
    received_[good++].bytes = {slots_[at].frame.data(), std::min<std::size_t>(heads_[at].msg_len, fd_size)};
  }
  return {received_.data(), good};
}

std::uint32_t CanSocket::ask_dropped() noexcept {
  std::array<std::uint32_t, SK_MEMINFO_VARS> info{};
  socklen_t size = sizeof info;
  if (fd_ >= 0 && ::getsockopt(fd_, SOL_SOCKET, SO_MEMINFO, info.data(), &size) == 0 && size == sizeof info)
    dropped_ = info[SK_MEMINFO_DROPS];
  return dropped_;
}

}  // namespace berth::io
