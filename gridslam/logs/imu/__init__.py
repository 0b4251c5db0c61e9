"""IMU messages: turning rates, gravity, and the lag of their clock."""
