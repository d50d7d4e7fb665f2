program main
   use rodyn, only: wp
   implicit none (type, external)
   print *, wp
end program main
