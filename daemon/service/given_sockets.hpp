#pragma once

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/unique_fd.hpp"

namespace geoflow::daemon::service {

/// Listening sockets that the service manager made and passed on (socket activation,
/// sd_listen_fds(3)); one that it did not pass is empty.
struct GivenSockets {
  UniqueFd pose;
  UniqueFd control;
};

/// Takes the descriptors that $LISTEN_FDS says were passed, by their names in $LISTEN_FDNAMES:
/// `pose`, a SOCK_SEQPACKET socket, and `control`, a SOCK_STREAM one, both AF_UNIX and listening.
/// They become nonblocking and are closed on exec. To be called once, before any thread starts: it
/// removes these variables from the environment. Errors, kInvalidArgument and naming the variable:
/// what is no number, a descriptor that is not open, an unknown or repeated name, a socket of
/// another kind.
[[nodiscard]] Result<GivenSockets> take_given_sockets();

}  // namespace geoflow::daemon::service
